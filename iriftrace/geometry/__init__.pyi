from .ply import read_ply as read_ply
from .ply import write_ply as write_ply
from .query import Surface as Surface
from .transform import parse_transform as parse_transform
