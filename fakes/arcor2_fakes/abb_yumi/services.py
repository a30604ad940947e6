"""Resources of Robot Web Services 1.0: panel, RAPID, mastership, motion system, event log."""

import math
import re
from collections.abc import Callable
from typing import Final

from arcor2_fakes.abb_yumi.controller import DOMAINS, TASKS, UNITS, Controller, Holder
from arcor2_fakes.abb_yumi.http_port import Answer, Request
from arcor2_fakes.abb_yumi.kinematics import quaternion

# Placeholders for the controller's own numbers, which differ between releases.
NOT_FOUND: Final = Answer(404, error=(-1073442814, "resource not found"))
NOT_HELD: Final = Answer(403, error=(-1073445859, "mastership of the domain is not held by this session"))
BAD_VALUE: Final = Answer(400, error=(-1073442811, "invalid value"))
WRONG_STATE: Final = (403, -1073445865, "operation not allowed in the current state of the controller")

_NAMES: Final = {unit: arm for arm, unit in UNITS.items()}
_ARMS: Final = {task: arm for arm, task in TASKS.items()}


def _one(kind: str, title: str, **fields: object) -> Answer:
    return Answer(states=[(kind, title, {name.replace("_", "-"): str(value) for name, value in fields.items()})])


def _done(held: bool) -> Answer:
    status, code, text = WRONG_STATE
    return Answer(204) if held else Answer(status, error=(code, text))


class Services:
    """Answers requests with the state of the controller."""

    def __init__(self, controller: Controller) -> None:
        self._controller = controller
        self._gets: list[tuple[re.Pattern[str], Callable[[re.Match[str]], Answer]]] = []
        for pattern, answer in (
            (r"/rw/panel/(ctrlstate|opmode|speedratio|coldetstate)", self._panel),
            (r"/rw/rapid/execution", self._execution),
            (r"/rw/rapid/tasks", self._tasks),
            (r"/rw/rapid/tasks/(T_ROB_[LR])/program", self._program),
            (r"/rw/motionsystem/mechunits/(ROB_[LR])/jointtarget", self._jointtarget),
            (r"/rw/motionsystem/mechunits/(ROB_[LR])/robtarget", self._robtarget),
            (r"/rw/motionsystem/mechunits/(ROB_[LR])/lead-through", self._lead_through),
            (r"/rw/elog/0", self._log),
            (r"/rw/system", lambda _: _one("sys-system-li", "sys", name="yumi", rwversion="6.13.0190", sysid="{0}")),
            (r"/ctrl/identity", self._identity),
        ):
            self._gets.append((re.compile(pattern), answer))

    def handle(self, request: Request) -> Answer:
        """Answer one request."""
        if request.method == "GET":
            if mastership := re.fullmatch(r"/rw/mastership/(\w+)", request.path):
                return self._mastership(mastership[1], request)
            for pattern, answer in self._gets:
                if found := pattern.fullmatch(request.path):
                    return answer(found)
            return NOT_FOUND
        if request.method == "POST":
            return self._post(request)
        return Answer(405, error=(-1073442810, "method not allowed"))

    # -------------------------------------------------------------------------------- reading
    def _panel(self, found: re.Match[str]) -> Answer:
        c, name = self._controller, found[1]
        value = {
            "ctrlstate": c.control_state,
            "opmode": c.operation_mode,
            "speedratio": str(c.speed_ratio),
            "coldetstate": c.collision,
        }[name]
        return Answer(states=[(f"pnl-{name}", name, {name: value})])

    def _execution(self, _: re.Match[str]) -> Answer:
        running = "running" if self._controller.running else "stopped"
        return _one("rap-execution", "execution", ctrlexecstate=running, cycle="forever")

    def _tasks(self, _: re.Match[str]) -> Answer:
        state = "started" if self._controller.running else "stopped"
        fields = {"type": "normal", "taskstate": "linked", "excstate": state, "active": "On", "motiontask": "TRUE"}
        return Answer(states=[("rap-task-li", task, {"name": task, **fields}) for task in _ARMS])

    def _program(self, found: re.Match[str]) -> Answer:
        name = self._controller.programs[_ARMS[found[1]]]
        return _one("rap-program", "program", name=name, entrypoint="main")

    def _jointtarget(self, found: re.Match[str]) -> Answer:
        q = [math.degrees(value) for value in self._controller.arms[_NAMES[found[1]]].q]
        fields = {f"rax_{number}": f"{value:.6f}" for number, value in enumerate(q[:6], 1)}
        fields |= {"eax_a": f"{q[6]:.6f}"} | {f"eax_{letter}": "9E+09" for letter in "bcdef"}
        return Answer(states=[("ms-jointtarget", "jointtarget", fields)])

    def _robtarget(self, found: re.Match[str]) -> Answer:
        arm = self._controller.arms[_NAMES[found[1]]]
        target = arm.kinematics.describe(arm.q)
        values = zip(("x", "y", "z"), target.pose[:3, 3] * 1e3, strict=True)
        fields = {name: f"{value:.6f}" for name, value in values}
        turned = quaternion(target.pose[:3, :3])
        fields |= {f"q{number}": f"{value:.9f}" for number, value in enumerate(turned, 1)}
        fields |= {n: str(v) for n, v in zip(("cf1", "cf4", "cf6", "cfx"), target.configuration, strict=True)}
        fields |= {"eax_a": f"{math.degrees(target.angle):.6f}"} | {f"eax_{letter}": "9E+09" for letter in "bcdef"}
        return Answer(states=[("ms-robtargets", "robtarget", fields)])

    def _lead_through(self, found: re.Match[str]) -> Answer:
        on = self._controller.arms[_NAMES[found[1]]].lead_through
        return _one("ms-mechunit-lead-through", found[1], status="Active" if on else "Inactive")

    def _log(self, _: re.Match[str]) -> Answer:
        return Answer(
            states=[
                (
                    "elog-message-li",
                    f"/rw/elog/0/{event.number}",
                    {"msgtype": str(event.kind), "code": str(event.code), "tstamp": event.stamp, "title": event.title},
                )
                for event in self._controller.events
            ]
        )

    def _identity(self, _: re.Match[str]) -> Answer:
        return _one("ctrl-identity-info", "identity", ctrl_name="IRB14000", ctrl_id="14000-500000", ctrl_type="RC")

    def _mastership(self, domain: str, request: Request) -> Answer:
        if domain not in DOMAINS:
            return NOT_FOUND
        holder = self._controller.mastership[domain]
        if holder is None:
            return _one("msh-resource", domain, mastership="nomaster", uid=0, application="", location="", alias="")
        mine = holder.session == request.session.number
        return Answer(
            states=[
                (
                    "msh-resource",
                    domain,
                    {
                        "mastership": "remote" if holder.session else "local",
                        "uid": str(holder.session),
                        "application": holder.application,
                        "location": holder.location,
                        "alias": holder.alias,
                        "mastershipheldbyme": "TRUE" if mine else "FALSE",
                    },
                )
            ]
        )

    # -------------------------------------------------------------------------------- acting
    def _post(self, request: Request) -> Answer:
        c, action = self._controller, request.query.get("action", "")
        mastership = re.fullmatch(r"/rw/mastership/(\w+)", request.path)
        if mastership is not None:
            return self._master(mastership[1], action, request)
        if request.path == "/rw/panel/ctrlstate" and action == "setctrlstate":
            state = request.body.get("ctrl-state")
            return _done(c.motors(state == "motoron")) if state in ("motoron", "motoroff") else BAD_VALUE
        if request.path == "/rw/panel/speedratio" and action == "setspeedratio":
            ratio = request.body.get("speed-ratio", "")
            if not ratio.isdigit() or not 0 <= int(ratio) <= 100:
                return BAD_VALUE
            c.speed_ratio = int(ratio)
            return Answer(204)
        if request.path == "/rw/rapid/execution":
            return self._execute(action, request)
        through = re.fullmatch(r"/rw/motionsystem/mechunits/(ROB_[LR])/lead-through", request.path)
        if through is not None:
            if not self._holds("motion", request):
                return NOT_HELD
            status = request.body.get("status")
            if status not in ("active", "inactive"):
                return BAD_VALUE
            return _done(c.set_lead_through(_NAMES[through[1]], status == "active"))
        return NOT_FOUND

    def _execute(self, action: str, request: Request) -> Answer:
        c = self._controller
        if action == "stop":  # from any client, as at the pendant
            c.stop()
            return Answer(204)
        if action not in ("start", "resetpp"):
            return BAD_VALUE
        if not self._holds("rapid", request):
            return NOT_HELD
        return _done(c.start() if action == "start" else c.to_main())

    def _holds(self, domain: str, request: Request) -> bool:
        holder = self._controller.mastership[domain]
        return holder is not None and holder.session == request.session.number

    def _master(self, domain: str, action: str, request: Request) -> Answer:
        c = self._controller
        if domain not in DOMAINS:
            return NOT_FOUND
        holder = c.mastership[domain]
        if action == "request":
            if holder is not None and not self._holds(domain, request):
                return Answer(403, error=(-1073445846, f"mastership is held by {holder.alias}"))
            if holder is None:
                c.wrote(f"mastership {domain}")
            c.mastership[domain] = Holder(request.session.number, request.session.user, "RWS", "remote client")
            return Answer(204)
        if action == "release":
            if not self._holds(domain, request):
                return NOT_HELD
            c.mastership[domain] = None
            return Answer(204)
        return BAD_VALUE
