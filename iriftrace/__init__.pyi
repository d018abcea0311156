from .air.refractivity import Air as Air
from .camera.camera import Camera as Camera
from .camera.pose import look_at as look_at
from .field.index_field import IndexField as IndexField
from .field.read import read_field as read_field
from .figures.pose import displacement_figure as displacement_figure
from .figures.result import plot as plot
from .figures.style import write_figure as write_figure
from .image.aov_image import AovImage as AovImage
from .image.aov_image import read_exr as read_exr
from .image.coverage import seen_areas as seen_areas
from .image.displacement import displacement_map as displacement_map
from .image.displacement import shift_map as shift_map
from .image.metrics import pose_metrics as pose_metrics
from .part.part import Part as Part
from .part.part import read_part as read_part
from .scene.build import build_ensemble as build_ensemble
from .scene.build import build_scene as build_scene
from .scene.load import load_scene as load_scene
from .scene.write import write_scene as write_scene
from .shells.contour import contour_shells as contour_shells
from .shells.files import load_shells as load_shells
from .shells.imported import import_shells as import_shells
from .trace.render import render_scene as render_scene
from .trace.render import trace_rays as trace_rays

__version__: str
