"""Programs of clients, received as text on the ports 30001, 30002 and 30003. A new program replaces the playing one."""

import logging

from arcor2_fakes.ur.control_script import ControlScript
from arcor2_fakes.ur.controller import Controller, Program, Refused
from arcor2_fakes.ur.language import WrittenProgram, run_secondary
from arcor2_fakes.ur.urscript import Splitter
from arcor2_fakes.wire import Connection

log = logging.getLogger("script")


class ScriptPort:
    """All clients of the ports that receive programs."""

    def __init__(self, controller: Controller) -> None:
        self.controller = controller
        self.scripts_taken = 0
        self.scripts_ignored = 0

    def opened(self, connection: Connection) -> None:
        """Serve a client."""
        splitter = Splitter()

        def received(data: bytes) -> None:
            try:
                for kind, name, text in splitter.feed(data):
                    self.take(kind, name, text)
            except ValueError as e:
                log.info("client dropped: %s", e)
                connection.close()

        connection.received = received

    def take(self, kind: str, name: str, text: str) -> None:
        """Play a script, if possible; the port sends no answer."""
        if not self.controller.remote:
            self.scripts_ignored += 1
            log.info("not in remote control: script %s ignored", name)
            return
        self.scripts_taken += 1
        if kind == "sec":  # a secondary program runs concurrently and takes no time
            try:
                run_secondary(self.controller, name, text)
            except (ValueError, TypeError, LookupError, ArithmeticError) as e:
                log.info("secondary program %s: runtime error: %s", name, e)
                self.controller.failed(str(e))
            return
        if kind == "line" and name.startswith(("stopj", "stopl", "halt")):
            self.controller.note_stop("script", name)
        program: Program
        if ControlScript.is_one(text):
            program = ControlScript(self.controller, text)
        else:
            try:
                program = WrittenProgram(self.controller, name, text)
            except ValueError as e:
                log.info("program %s cannot be read: %s", name, e)
                self.controller.failed(str(e))
                return
        try:
            self.controller.start_program(program)
        except Refused as e:
            log.info("script %s ignored: %s", name, e)
