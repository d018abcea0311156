from .render import RayHits as RayHits
from .render import Rendering as Rendering
from .render import is_inside as is_inside
from .render import render_scene as render_scene
from .render import trace_rays as trace_rays
