from .export import write_surface as write_surface
from .export import write_table as write_table
from .reload import SweptScene as SweptScene
from .reload import load_swept_scene as load_swept_scene
from .store import read_sweep as read_sweep
from .sweep import SweepOptions as SweepOptions
from .sweep import run_sweep as run_sweep
from .workers import pose_workers as pose_workers
