"""Test cases of declarations: metadata, capabilities, types."""

from arcor2_hw.data.base import Unset
from arcor2_hw.data.points import PointUse
from arcor2_hw.exceptions import InvalidData, KinematicsError, NotFound, OutOfRange, Refused
from arcor2_hw.objects.small import HasPoints
from arcor2_hw.testing import capabilities, declarations
from arcor2_hw.testing.bench import Bench, needs
from arcor2_hw.testing.life import require_error, require_in_time


class WrittenCases:
    """Cases that compare what a driver declares with what it does."""

    def test_described(self, arcor2_bench: Bench) -> None:
        """Metadata, docstrings, stop and state, loss_reaction and quality.yaml are valid; nothing is abstract."""
        wrong = declarations.faults(declarations.source_of(arcor2_bench.object_type))
        assert not wrong, "; ".join(wrong)
        assert not arcor2_bench.object_type.abstract()

    def test_translations_match(self, arcor2_bench: Bench) -> None:
        """Translations are valid JSON, translate texts of the driver, and contain the fields of their templates."""
        wrong = declarations.translation_faults(declarations.source_of(arcor2_bench.object_type))
        assert not wrong, "; ".join(wrong)

    def test_alarms_declared(self, arcor2_bench: Bench) -> None:
        """alarms.toml has no unknown keys or duplicates, and every alarm has a cause, a remedy and its translations."""
        wrong = declarations.alarm_faults(declarations.source_of(arcor2_bench.object_type))
        assert not wrong, "; ".join(wrong)

    def test_types_complete(self, arcor2_bench: Bench) -> None:
        """Every public method has a type hint for each parameter and for the result."""
        lacking = capabilities.unhinted(arcor2_bench.object_type)
        assert not lacking, f"type hints are missing at {', '.join(lacking)}"

    def test_long_actions_can_be_stopped(self, arcor2_bench: Bench) -> None:
        """Every action that may last longer than 1 s is ended by stop() or by its method in CANCEL_MAPPING."""
        found = capabilities.unstoppable(arcor2_bench.object_type)
        assert not found, (
            f"{', '.join(found)} cannot be stopped: define stop(), name a method in CANCEL_MAPPING, or declare that an "
            f"action ends within {capabilities.STOPPABLE_FROM:g} s by @action(quick=True)"
        )

    def test_capabilities_declared(self, arcor2_bench: Bench) -> None:
        """An optional method exists where the analysis finds it, and raises not-implemented elsewhere."""
        said = capabilities.declared(arcor2_bench.object_type)
        wrong = capabilities.contradictions(arcor2_bench.new(), said)
        assert not wrong, "; ".join(wrong)

    def test_readings_can_be_read(self, arcor2_bench: Bench) -> None:
        """Readings that need neither arguments nor control return, or raise a typed error, on a connected device."""
        device = arcor2_bench.connected()
        said = capabilities.declared(arcor2_bench.object_type)
        for name in capabilities.readable(type(device), said):
            try:
                getattr(device, name)()
            except (Refused, InvalidData, NotFound):
                continue  # the method needs another state or arguments
            except Exception as error:
                raise AssertionError(f"{name}() raised {type(error).__name__}: {error}") from error

    def test_points_declared(self, arcor2_bench: Bench) -> None:
        """Points have distinct names and are returned at once, and forces are offered only where a crash ends them."""
        device = arcor2_bench.connected()
        points = require_in_time(device.live_points, 1.0, "live_points")
        names = [point.name for point in points]
        assert len(names) == len(set(names)), "live_points returns a name twice"
        forcible = [point.name for point in points if not isinstance(point.force, Unset)]
        lasting = [point.name for point in points if point.use is not PointUse.OUTPUT and point.name in forcible]
        assert not lasting, f"only outputs can be forced, not {', '.join(lasting)}"
        if isinstance(device, HasPoints):
            kept = {point.name for point in device.points() if not point.forcible} & set(forcible)
            assert not kept, f"{', '.join(sorted(kept))} would stay forced after a crash of the host"
        if forcible:
            missing = {"force_point", "release_point"} - capabilities.declared(arcor2_bench.object_type)
            assert not missing, f"points can be forced, but {', '.join(sorted(missing))} is missing"

    @needs("works", for_silver=True)
    def test_capabilities_work(self, arcor2_bench: Bench) -> None:
        """Every declared optional method that acts on the device works."""
        device = arcor2_bench.controlled()
        said, wanted = (each(type(device)) for each in (capabilities.declared, capabilities.to_be_shown))
        shown = dict(arcor2_bench.works(device))
        assert not (undeclared := set(shown) - said), (
            f"the bench calls methods that are not declared: {', '.join(sorted(undeclared))}"
        )
        assert not (missing := wanted - set(shown)), f"the bench does not call {', '.join(sorted(missing))}"
        for name, call in shown.items():
            try:
                call()
            except Exception as error:
                raise AssertionError(f"{name} is declared, but raised {type(error).__name__}: {error}") from error

    @needs("readings", for_silver=True)
    def test_units_and_frames(self, arcor2_bench: Bench) -> None:
        """Readings equal the values of the device itself, in SI units, with its signs and in the declared frame."""
        checks = list(arcor2_bench.readings(arcor2_bench.connected()))
        assert checks, "the bench does not compare any reading"
        for each in checks:
            assert each.agrees, str(each)
        assert any(each.by_device for each in checks), (
            "all values of the device are zero, so units and signs are not tested"
        )

    @needs("results", for_silver=True)
    def test_results_are_current(self, arcor2_bench: Bench) -> None:
        """Actions return the value that the device has at that time, also after it has changed (rule 6)."""
        real: dict[str, list[object]] = {}
        for each in arcor2_bench.results(arcor2_bench.controlled()):
            assert each.agrees, str(each)
            real.setdefault(each.what, []).append(each.by_device)
        assert real, "the bench does not call any action"
        missing = capabilities.returning(arcor2_bench.object_type) - set(real)
        assert not missing, f"the bench does not call {', '.join(sorted(missing))}"
        same = [what for what, values in real.items() if all(value == values[0] for value in values)]
        assert not same, f"the value of the device does not change between the calls of {', '.join(same)}"

    @needs("beyond_limits", for_silver=True)
    def test_limits_are_refused(self, arcor2_bench: Bench) -> None:
        """Values beyond a limit are refused with a typed error that names the device, without effect."""
        device = arcor2_bench.controlled()
        calls = arcor2_bench.beyond_limits(device)
        assert calls, "the bench does not try any limit"
        for what, call in calls.items():
            before = arcor2_bench.writes() if arcor2_bench.has("writes") else None
            error = require_error(
                call, OutOfRange, Refused, KinematicsError, within=arcor2_bench.call_within, what=what
            )
            text = f"{error} {error.detail}"
            assert device.name in text, f"the refusal of {what} does not name {device.name!r}: {text}"
            if before is not None:
                assert arcor2_bench.writes() == before, f"{what} was refused, but acted on the device"
