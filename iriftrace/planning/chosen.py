"""The poses that a plan chose, as a file for scenes, sweeps and other programs."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from iriftrace.camera.pose_set import PoseSet
from iriftrace.io.poses import OPENCV, Convention, write_poses
from iriftrace.planning.pose_plan import PosePlan


def write_chosen(
    path: str | Path, plan: PosePlan, count: int = 1, convention: Convention = OPENCV
) -> None:
    """Write the chosen poses of a plan, best first, as `iriftrace.io.poses.write_poses`.

    They are the refined pose, the poses that together see the most, or the best `count` of the
    ranking. A ``.json`` also has ``focus_mm``, the distance of each camera from its target, and for
    a rigid sensor ``second``: the id of the second device and ``to_first``, the (4, 4) motion, mm,
    from its frame to the camera's, both with x right, y down, z forward.
    """
    summary, refined = plan.summary, plan.refined
    if refined is not None:
        poses = PoseSet(refined.matrix[None], np.array([np.nan]), np.array([np.nan]))
        focus = [refined.distance_mm]
    else:
        chosen = summary.plan.order[:count] if plan.views is None else plan.views.poses
        angles = (summary.azimuth[chosen], summary.elevation[chosen])
        poses = PoseSet(summary.matrices[chosen], *angles)
        focus = summary.distance[chosen].tolist()
    rig = {"second": summary.rig} if summary.rig else {}
    write_poses(path, poses, convention, {"focus_mm": focus, **rig})
