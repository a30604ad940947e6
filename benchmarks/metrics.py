"""Metrics: their goals, measured values, and the report."""

import statistics
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final

import msgspec
from rich.console import Console
from rich.table import Table

GOALS: Final[dict[str, tuple[str, str]]] = {
    # name: unit, goal
    "cold_start_s": ("s", "<= 1.0"),
    "start_server_ratio": ("x interpreter", "<= 16"),
    "start_host_ratio": ("x interpreter", "<= 3"),
    "idle_memory_mib": ("MiB", "<= 150"),
    "rpc_ratio_system_info": ("x echo", "<= 1.3"),
    "rpc_ratio_list_scenes": ("x echo", "<= 1.3"),
    "rpc_ratio_object_types": ("x echo", "<= 1.3"),
    "add_action_10_ms": ("ms beyond echo and fdatasync", "<= 0.3"),
    "add_action_1000_ms": ("ms beyond echo and fdatasync", "<= 0.3"),
    "add_action_10000_ms": ("ms beyond echo and fdatasync", "<= 0.3"),
    "add_logic_item_chain_ms": ("ms beyond echo and fdatasync", "<= 1"),
    "add_logic_item_branches_ms": ("ms beyond echo and fdatasync", "<= 1"),
    "open_project_1000_ms": ("ms", "<= 50"),
    "save_project_1000_ms": ("ms", "<= 5"),
    "list_projects_200_ms": ("ms", "<= 2"),
    "list_projects_200_changed_ms": ("ms", ""),
    "list_projects_200_first_ms": ("ms", "<= 20"),
    "save_sqlite_ms": ("ms", ""),
    "save_sqlite_p99_ms": ("ms", ""),
    "save_postgresql_ms": ("ms", ""),
    "save_postgresql_p99_ms": ("ms", ""),
    "backup_save_delay_ms": ("ms", "<= 100"),
    "backup_s": ("s", ""),
    "restart_2_busy_p95_s": ("s", "<= 2"),
    "restart_8_busy_p95_s": ("s", "<= 6"),
    "event_last_of_50_ms": ("ms", "<= 1.5"),
    "deliveries_per_s": ("events/s", ">= 120000"),
    "deaf_clients_mib": ("MiB", "<= 50"),
    "deaf_clients_delay_ms": ("ms", "<= 0.5"),
    "run_first_action_ms": ("ms", "<= 150"),
    "action_overhead_ms": ("ms", "<= 0.1"),
    "checkpoint_ms": ("ms beyond 2 fdatasync", "<= 0.2"),
    "pausing_ms": ("ms", "<= 10"),
    "step_ms": ("ms", "<= 10"),
    "resume_ms": ("ms", "<= 10"),
    "stopping_ms": ("ms", "<= 10"),
    "stopped_ms": ("ms", "<= 50"),
    "run_1000_distinct_s": ("s", "<= 2"),
    "scene_start_20_s": ("s", "<= 0.55"),
    "stop_latency_p99_ms": ("ms", "<= 100"),
    "ur_stream_lost": ("%", "<= 0.5"),
    "ur_stream_core_percent": ("% of a core", "<= 10"),
    "jog_missed_to_rest_p99_ms": ("ms", "<= 500"),
    "jog_renewal_ms": ("ms", "<= 50"),
    "modbus_read_ratio": ("of the bare library's rate", ">= 0.9"),
    "opcua_server_core_percent": ("% of a core", "<= 2"),
    "opcua_process_core_percent": ("% of a core", "<= 20"),
    "mqtt_server_core_percent": ("% of a core", "<= 2"),
    "mqtt_process_core_percent": ("% of a core", "<= 20"),
    "history_cold_mib": ("MiB", "<= 5"),
    "history_day_ms": ("ms", "<= 200"),
    "history_month_ms": ("ms", "<= 500"),
    "history_core_percent": ("% of a core", "<= 5"),
    "fleet_page_ms": ("ms", ""),
    "fleet_server_core_percent": ("% of a core", "<= 10"),
    "fleet_broker_core_percent": ("% of a core", ""),
    "fleet_page_core_percent": ("% of a core", ""),
    "fleet_update_p95_ms": ("ms", "<= 500"),
    "fleet_dead_cell_s": ("s", "<= 2"),
    "fleet_results_queued_s": ("s", ""),
    "fleet_results_at_site_s": ("s", ""),
    "fleet_results_arrived_s": ("s", ""),
    "fleet_results_lost": ("results", "<= 0"),
    "fleet_results_doubled": ("results", "<= 0"),
    "fleet_production_ms": ("ms", "<= 300"),
    "fleet_bad_units_ms": ("ms", "<= 300"),
    "fleet_bad_units_of_cell_ms": ("ms", "<= 300"),
    "fleet_search_ms": ("ms", "<= 300"),
    "fleet_search_in_cell_ms": ("ms", "<= 300"),
    "fleet_search_cold_ms": ("ms", "<= 300"),
    "fleet_search_in_cell_cold_ms": ("ms", "<= 300"),
    "fleet_alarms_ms": ("ms", "<= 300"),
    "fleet_causes_ms": ("ms", "<= 300"),
    "can_pdo_lost": ("frames", "<= 0"),
    "dynamixel_sync_read_6_ms": ("ms", "<= 1"),
    "meshes_robot_triangles": ("", "<= 40000"),
    "meshes_robot_mb": ("MB", "<= 1.5"),
    "meshes_robot_s": ("s", "<= 3"),
    "meshes_again_ms": ("ms", "<= 10"),
    "hung_beside_p99_ms": ("ms", "<= 50"),
    "node_call_added_p50_ms": ("ms", "<= 2"),
    "node_call_added_p99_ms": ("ms", "<= 10"),
    "node_stop_beside_pictures_p99_ms": ("ms", "<= 20"),
    "node_cut_stopped_s": ("s", "<= 0.5"),
    "node_cut_named_s": ("s", "<= 1"),
    "node_program_call_added_p50_ms": ("ms", "<= 2"),
    "node_program_call_added_p99_ms": ("ms", "<= 10"),
    "node_stop_all_p99_ms": ("ms", "<= 20"),
    "node_lost_others_stopped_s": ("s", "<= 0.5"),
    "node_broker_p99_ms": ("ms", ""),
    "node_socket_p99_ms": ("ms", ""),
    "node_zenoh_p99_ms": ("ms", ""),
    "recovery_p95_s": ("s", "<= 5"),
    "recovery_growth": ("threads, descriptors, tasks", "<= 0"),
    "driver_stop_p99_ms": ("ms", "<= 100"),
    "busy_stops_lost": ("stops", "<= 0"),
    "busy_stop_p99_ms": ("ms", "<= 200"),
    "busy_demo_completed": ("% of runs", ">= 100"),
    "parts_unaccounted": ("differences", "<= 0"),
    "parts_results_not_once": ("boards", "<= 0"),
    "parts_moved_alone": ("motions", "<= 0"),
    "parts_unresolved": ("faults", "<= 0"),
    "recorder_core_percent": ("% of a core", "<= 2"),
    "dry_run_demo_percent": ("%", "<= 10"),
    "dry_run_demo_planned_percent": ("%", ""),
    "demo_parallel_percent": ("% of the cycle", ""),
    "dry_run_1000_s": ("s", "<= 2"),
    "oak_core_percent": ("% of a core", "<= 25"),
    "camera_pose_three_mm": ("mm", "<= 1"),
    "camera_pose_three_p99_mm": ("mm", "<= 3"),
    "camera_pose_three_deg": ("°", "<= 0.1"),
    "camera_pose_three_ms": ("ms", "<= 15"),
    "camera_pose_three_per_opencv": ("x", "<= 1.3"),
    "camera_pose_three_refused": ("%", ""),
    "camera_pose_three_wrong": ("%", "<= 1"),
    "camera_pose_one_mm": ("mm", "<= 3"),
    "camera_pose_one_p99_mm": ("mm", "<= 10"),
    "camera_pose_one_deg": ("°", ""),
    "camera_pose_one_ms": ("ms", "<= 15"),
    "camera_pose_one_refused": ("%", ""),
    "camera_pose_one_wrong": ("%", "<= 1"),
    "camera_pose_board_mm": ("mm", "<= 1"),
    "camera_pose_board_p99_mm": ("mm", "<= 10"),
    "camera_pose_board_deg": ("°", "<= 0.1"),
    "camera_pose_board_ms": ("ms", "<= 15"),
    "camera_pose_board_refused": ("%", ""),
    "camera_pose_board_wrong": ("%", "<= 1"),
    "analyse_11_ms": ("ms", "<= 20"),
    "build_1000_ms": ("ms", "<= 100"),
    "build_10000_ms": ("ms", "<= 1000"),
    "read_script_1000_ms": ("ms", "<= 200"),
    "merge_script_1000_ms": ("ms", "<= 300"),
    "computing_line_1000_ms": ("ms", "<= 10"),
    "computing_start_ms": ("ms", "<= 1000"),
    "computing_question_ms": ("ms", "<= 2"),
    "computing_world_1000_ms": ("ms", "<= 20"),
    "computing_reach_3000_s": ("s", "<= 1"),
    "kinematics_forward_us": ("µs", "<= 1"),
    "robot_pose_mm": ("mm", "<= 1"),
    "robot_pose_deg": ("°", "<= 0.1"),
    "robot_pose_s": ("s", "<= 3"),
    "robot_pose_refused": ("%", ""),
    "robot_pose_wrong": ("%", "<= 1"),
    "robot_pose_impostors": ("% given and wrong", "<= 0"),
    "kinematics_inverse_reached": ("% of random reachable poses", ">= 99.9"),
    "kinematics_inverse_ms": ("ms", "<= 0.3"),
    "kinematics_inverse_per_cpp": ("x", "<= 5"),
    "kinematics_check_20_us": ("µs", "<= 50"),
    "kinematics_check_1000_us": ("µs", "<= 100"),
    "kinematics_reach_3000_s": ("s", "<= 1"),
    "kinematics_reach_moved_ms": ("ms", "<= 200"),
    "editor_size_kb": ("kB", "<= 264"),
    "editor_paint_s": ("s", "<= 1.5"),
    "editor_usable_s": ("s", "<= 2"),
    "editor_robot_s": ("s", "<= 3"),
    "editor_frames_per_s": ("frames/s", ">= 25"),
    "editor_event_to_pixels_ms": ("ms", "<= 50"),
    "editor_idle_frames": ("frames", "<= 0"),
    "editor_stop_ms": ("ms", "<= 100"),
    "editor_edit_ms": ("ms", "<= 150"),
    "editor_step_ms": ("ms", "<= 150"),
    "editor_back_s": ("s", "<= 2"),
    "editor_large_usable_s": ("s", "<= 3"),
    "editor_large_frame_ms": ("ms", "<= 50"),
    "editor_empty_frame_ms": ("ms", ""),
    "editor_large_list_s": ("s", "<= 1"),
    "select_crosshair_ms": ("ms", ""),
    "select_tap_ms": ("ms", ""),
    "select_list_ms": ("ms", ""),
    "ar_size_kb": ("kB", "<= 25"),
    "ar_registration_s": ("s", "<= 3"),
    "ar_regained_s": ("s", "<= 2"),
    "ar_near_mm": ("mm", "<= 1"),
    "ar_aside_mm": ("mm", "<= 2"),
    "ar_picture_ms": ("ms", "<= 250"),
    "select_ar_crosshair_ms": ("ms", ""),
    "select_ar_tap_ms": ("ms", ""),
    "task_seat_taps": ("taps", "<= 32"),
    "task_ar_taps": ("taps", "<= 34"),
    "task_seat_scrolls": ("scrolls", ""),
    "task_ar_scrolls": ("scrolls", ""),
    "task_seat_s": ("s", ""),
    "task_ar_s": ("s", ""),
    "kinematics_plans_found": ("of 20", ">= 20"),
    "kinematics_plan_ms": ("ms", "<= 50"),
}


@dataclass(frozen=True)
class Metric:
    """One measured value; `n` is the number of samples, `note` shows further observations."""

    name: str
    value: float
    n: int
    note: str = ""

    def reached(self) -> bool | None:
        """Return whether the goal is reached; None if the metric has no goal."""
        goal = GOALS.get(self.name, ("", ""))[1]
        if goal.startswith(">="):
            return self.value >= float(goal[2:])
        return self.value <= float(goal[2:]) if goal.startswith("<=") else None


class Report:
    """Prints each metric as a JSON line on standard output, and at the end all as a table on standard error."""

    def __init__(self) -> None:
        self._figures: list[Metric] = []

    def add(self, metric: Metric) -> None:
        """Print a metric and store it for the table."""
        unit, goal = GOALS.get(metric.name, ("", ""))
        self._figures.append(metric)
        line = {"name": metric.name, "value": round(metric.value, 4), "unit": unit, "n": metric.n, "goal": goal}
        sys.stdout.write(msgspec.json.encode(line).decode() + "\n")
        sys.stdout.flush()

    def errors(self) -> bool:
        """Return whether a metric that counts errors, of which none is allowed, is not 0."""
        return any(f.reached() is False and float(GOALS[f.name][1][2:]) == 0 for f in self._figures)

    def table(self) -> None:
        """Print the table."""
        table = Table("metric", "value", "unit", "n", "goal", "", "note")
        for f in self._figures:
            unit, goal = GOALS.get(f.name, ("", ""))
            mark = {True: "[green]reached", False: "[red]missed", None: ""}[f.reached()]
            table.add_row(f.name, f"{f.value:.4g}", unit, str(f.n), goal, mark, f.note)
        console = Console(stderr=True)
        if not console.is_terminal:
            console = Console(stderr=True, width=180)
        console.print(table)


def median(samples: Sequence[float]) -> float:
    """Return the median."""
    return statistics.median(samples)


def percentile(samples: Sequence[float], percent: float) -> float:
    """Return a percentile by the nearest-rank method."""
    ordered = sorted(samples)
    return ordered[min(len(ordered) - 1, max(0, round(percent / 100 * len(ordered) + 0.5) - 1))]
