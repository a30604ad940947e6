"""All tasks of the compute workers. Imports no numerics."""

from arcor2_hw.compute.calibration_tasks import CalibrationTask
from arcor2_hw.compute.dry_run_tasks import DryRunTask
from arcor2_hw.compute.history_tasks import HistoryTask
from arcor2_hw.compute.kinematics_tasks import KinematicsTask
from arcor2_hw.compute.mesh_tasks import MeshTask

AnyTask = CalibrationTask | DryRunTask | HistoryTask | KinematicsTask | MeshTask
