"""The leak check itself: each kind of leak fails, and a clean test passes."""

import pytest

CONFTEST = 'pytest_plugins = ["tests.leaks"]\nimport tests.leaks\ntests.leaks.GRACE = 0.2\n'


@pytest.fixture(autouse=True)
def no_other_plugins(monkeypatch: pytest.MonkeyPatch) -> None:
    """Do not load other installed plugins, which takes seconds."""
    monkeypatch.setenv("PYTEST_DISABLE_PLUGIN_AUTOLOAD", "1")


@pytest.mark.parametrize(
    ("body", "named"),
    [
        ("import threading\ndef test(): threading.Thread(target=EVENT.wait, daemon=True).start()", "thread"),
        ("import subprocess\ndef test(): KEEP.append(subprocess.Popen(['sleep', '5']))", "process"),
        ("import socket\ndef test(): KEEP.append(socket.socket())", "socket"),
        ("import asyncio\nasync def test(): KEEP.append(asyncio.create_task(asyncio.sleep(9)))", "task"),
    ],
)
def test_a_leak_fails_the_test_that_caused_it(pytester: pytest.Pytester, body: str, named: str) -> None:
    pytester.makeconftest(CONFTEST)
    pytester.makepyfile("import threading\nKEEP = []\nEVENT = threading.Event()\n" + body + TIDY)
    result = pytester.runpytest_subprocess("-p", "pytest_asyncio.plugin", "--asyncio-mode=auto", "-W", "ignore")
    text = result.stdout.str()
    assert f"left behind: {named}" in text, text
    outcomes = result.parseoutcomes()
    assert outcomes.get("errors", 0) + outcomes.get("failed", 0) == 1, text


TIDY = """
def test_another(): pass

def teardown_module():
    EVENT.set()
    for thing in KEEP:
        for end in ("kill", "close"):
            if hasattr(thing, end):
                getattr(thing, end)()
        if hasattr(thing, "poll"):
            thing.wait()
"""


def test_cleaned_up_resources_and_those_of_wider_scope_pass(pytester: pytest.Pytester) -> None:
    pytester.makeconftest(CONFTEST)
    pytester.makepyfile(
        """
        import asyncio, socket, subprocess, threading
        import pytest

        @pytest.fixture(scope="module")
        def lasting():
            with socket.socket() as opened:
                yield opened

        @pytest.fixture(scope="module")
        def shell():
            with subprocess.Popen(["sh"], stdin=subprocess.PIPE, text=True) as process:
                yield process
                process.stdin.close()
                process.terminate()

        def test_a_process_that_starts_one(shell):
            shell.stdin.write("sleep 2 & wait\\n")
            shell.stdin.flush()

        def test_thread(lasting):
            thread = threading.Thread(target=lambda: None)
            thread.start()

        def test_process(lasting):
            with subprocess.Popen(["true"]) as process:
                process.wait()

        async def test_task():
            task = asyncio.create_task(asyncio.sleep(0))
            await task
        """
    )
    result = pytester.runpytest_subprocess("-p", "pytest_asyncio.plugin", "--asyncio-mode=auto")
    result.assert_outcomes(passed=4)
