"""Two users on one server: names, locks, and the departure of one user."""

from tests.server.core.serving import ServerProcess, talking


async def test_a_lock_is_announced_to_all_after_the_answer(server: ServerProcess) -> None:
    async with talking(server.url, "ann") as ann, talking(server.url, "bob") as bob, talking(server.url) as stranger:
        await ann.socket.send('{"id": 1, "request": "WriteLock", "args": {"object_id": "SCENE"}}')
        assert await ann.receive() == {"id": 1, "response": "WriteLock", "result": True}
        locked = {"event": "ObjectsLocked", "data": {"object_ids": ["SCENE"], "owner": "ann"}}
        for talker in (ann, bob, stranger):
            assert await talker.event("ObjectsLocked") == locked
        # A lock that the user already holds is granted again without an event.
        await ann.granted("WriteLock", {"object_id": "SCENE"})
        await ann.nothing_more()
        await bob.refused("WriteLock", {"object_id": "SCENE"})
        await bob.refused("WriteUnlock", {"object_id": "SCENE"})
        await bob.refused("ReadLock", {"object_id": "SCENE"})
        await ann.granted("WriteUnlock", {"object_id": "SCENE"})
        for talker in (ann, bob, stranger):
            assert (await talker.event("ObjectsUnlocked"))["data"] == locked["data"]
        await bob.granted("ReadLock", {"object_id": "SCENE"})
        await ann.refused("WriteLock", {"object_id": "SCENE"})
        await bob.granted("ReadUnlock", {"object_id": "SCENE"})
        for talker in (ann, bob):
            await talker.nothing_more()


async def test_a_tree_lock_is_widened_and_narrowed(server: ServerProcess) -> None:
    async with talking(server.url, "ann") as ann:
        await ann.refused("UpdateLock", {"object_id": "PROJECT", "new_type": "TREE"})
        await ann.granted("WriteLock", {"object_id": "PROJECT"})
        await ann.event("ObjectsLocked")
        await ann.granted("UpdateLock", {"object_id": "PROJECT", "new_type": "TREE"})
        # Only the id of the root is locked.
        assert (await ann.event("ObjectsLocked"))["data"]["object_ids"] == []
        await ann.refused("UpdateLock", {"object_id": "PROJECT", "new_type": "TREE"})
        await ann.granted("UpdateLock", {"object_id": "PROJECT", "new_type": "OBJECT"})
        assert (await ann.event("ObjectsUnlocked"))["data"]["object_ids"] == []
        await ann.granted("WriteUnlock", {"object_id": "PROJECT"})


async def test_locks_need_a_registered_user_and_a_known_id(server: ServerProcess) -> None:
    async with talking(server.url) as talker:
        await talker.refused("WriteLock", {"object_id": "SCENE"})
        await talker.granted("RegisterUser", {"user_name": "ann"})
        assert "nothing_known" in await talker.refused("WriteLock", {"object_id": "nothing_known"})
        await talker.refused("UpdateLock", {"object_id": "SCENE", "new_type": "tree"})


async def test_a_user_name_is_unique(server: ServerProcess) -> None:
    async with talking(server.url, "ann"), talking(server.url) as second:
        await second.refused("RegisterUser", {"user_name": ""})
        await second.refused("RegisterUser", {"user_name": "ann"})
        await second.granted("RegisterUser", {"user_name": "bob"})
        await second.granted("RegisterUser", {"user_name": "bob"})
    async with talking(server.url, "ann"), talking(server.url, "bob"):
        pass


async def test_a_user_name_moves_from_an_unresponsive_connection(server: ServerProcess) -> None:
    async with talking(server.url, "ann") as gone:
        gone.socket.transport.pause_reading()
        async with talking(server.url) as back:
            await back.granted("RegisterUser", {"user_name": "ann"})
            await back.granted("WriteLock", {"object_id": "SCENE"})
            gone.socket.transport.resume_reading()
            # The old connection has no user any more.
            assert "log" in await gone.refused("WriteLock", {"object_id": "PROJECT"})
            await back.granted("WriteUnlock", {"object_id": "SCENE"})


async def test_a_new_client_receives_the_locks(server: ServerProcess) -> None:
    async with talking(server.url, "ann") as ann:
        for item in ("SCENE", "PROJECT"):
            await ann.granted("WriteLock", {"object_id": item})
        async with talking(server.url) as bob:
            await bob.nothing_more()
            await bob.granted("RegisterUser", {"user_name": "bob"})
            locked = await bob.event("ObjectsLocked")
            assert locked["data"] == {"object_ids": ["PROJECT", "SCENE"], "owner": "ann"}
            await bob.nothing_more()
        for item in ("SCENE", "PROJECT"):
            await ann.granted("WriteUnlock", {"object_id": item})


async def test_locks_of_a_disconnected_user_are_released_after_a_delay(server: ServerProcess) -> None:
    async with talking(server.url, "bob") as bob:
        async with talking(server.url, "ann") as ann:
            await ann.granted("WriteLock", {"object_id": "SCENE"})
            await ann.granted("ReadLock", {"object_id": "ACTION"})
        await bob.event("ObjectsLocked")
        await bob.refused("WriteLock", {"object_id": "SCENE"})
        locked = await bob.event("ObjectsUnlocked")
        assert locked["data"] == {"object_ids": ["SCENE"], "owner": "ann"}
        for item in ("SCENE", "ACTION"):
            await bob.granted("WriteLock", {"object_id": item})
            await bob.event("ObjectsLocked")
            await bob.granted("WriteUnlock", {"object_id": item})
            await bob.event("ObjectsUnlocked")
        await bob.nothing_more()


async def test_a_user_who_reconnects_in_time_keeps_the_locks(server: ServerProcess) -> None:
    async with talking(server.url, "bob") as bob:
        async with talking(server.url, "ann") as ann:
            await ann.granted("WriteLock", {"object_id": "SCENE"})
        await bob.event("ObjectsLocked")
        async with talking(server.url, "ann") as ann:
            assert (await ann.event("ObjectsLocked"))["data"] == {"object_ids": ["SCENE"], "owner": "ann"}
            # Wait longer than the time-out: it belongs to the user's first connection; the second one cancels it.
            for _ in range(40):
                await bob.refused("WriteLock", {"object_id": "SCENE"})
                await bob.nothing_more()
                await ann.socket.ping()
            await ann.granted("WriteUnlock", {"object_id": "SCENE"})
            await bob.event("ObjectsUnlocked")
