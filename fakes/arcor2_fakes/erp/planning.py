"""The state of the service: orders, results, and the keys of accepted requests. Independent of HTTP."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any, Final

import msgspec

from arcor2_fakes.erp.http import Request

NAME: Final = "Fake planning"
VERSION: Final = "1.4.0"
MAX_KEY: Final = 200


class Problem(Exception):
    """The request is rejected and nothing has changed; `status` is the HTTP status."""

    def __init__(self, status: int, text: str) -> None:
        super().__init__(text)
        self.status = status


class Order(msgspec.Struct):
    """An order. `station` works on it; empty while it is not assigned."""

    id: str
    product: str
    quantity: int
    station: str = ""
    closed: bool = False

    def to_json(self) -> dict[str, Any]:
        """Return the order as JSON data."""
        return {"id": self.id, "product": self.product, "quantity": self.quantity}


class _OrderRequest(msgspec.Struct):
    station: str


class _Result(msgspec.Struct):
    order: str
    serial: str
    passed: bool
    note: str
    finished: str
    station: str


class _Closing(msgspec.Struct):
    order: str
    reason: str
    finished: str
    station: str


class _Event(msgspec.Struct, omit_defaults=True):
    """A line of the store: a new order or an accepted request."""

    order: Order | None = None
    key: str = ""
    path: str = ""
    body: str = ""


class Planning:
    """Orders and results. Each key is accepted once.

    Args:
        store: File for orders and results; None: they are stored in memory.
    """

    def __init__(self, store: Path | None = None) -> None:
        self.orders: dict[str, Order] = {}
        self.results: list[dict[str, Any]] = []
        self.taken: dict[str, tuple[str, str, dict[str, Any]]] = {}  # by key: path, body, answer
        self.repeated = 0
        self.forbidden: set[str] = set()
        self._store = None
        if store is not None:
            for line in store.read_bytes().splitlines() if store.exists() else ():
                self._replay(msgspec.json.decode(line, type=_Event))
            self._store = store.open("ab")

    def close(self) -> None:
        """Close the store."""
        if self._store is not None:
            self._store.close()

    def add_order(self, order: str, product: str, quantity: int) -> None:
        """Add an order. Raises ValueError."""
        if not order or not product or order in self.orders or not 1 <= quantity <= 100_000:
            raise ValueError("an order needs a unique id, a product, and a quantity of 1 to 100000")
        self.orders[order] = Order(order, product, int(quantity))
        self._append(_Event(order=self.orders[order]))

    def reset(self) -> None:
        """Delete all orders and results."""
        self.orders.clear()
        self.results.clear()
        self.taken.clear()
        self.forbidden.clear()
        self.repeated = 0
        if self._store is not None:
            self._store.truncate(0)

    # -------------------------------------------------------------------------------- requests
    def execute(self, request: Request) -> tuple[int, dict[str, Any]]:
        """Execute a request and return status and body. Raises Problem."""
        if request.path == "/status":
            self._method(request, "GET")
            return 200, {"service": NAME, "version": VERSION}
        if request.path not in ("/orders/next", "/results", "/orders/close"):
            raise Problem(404, f"path {request.path} does not exist")
        self._method(request, "POST")
        key = request.headers.get("idempotency-key", "")
        if not 0 < len(key) <= MAX_KEY:
            raise Problem(400, "Idempotency-Key is missing")
        try:
            body = request.body.decode()
        except UnicodeDecodeError as e:
            raise Problem(400, "the body is not UTF-8") from e
        if key in self.taken:
            path, before, answer = self.taken[key]
            if (path, before) != (request.path, body):
                raise Problem(409, f"the key {key} was used for another request")
            self.repeated += 1
            return 200, {**answer, "repeated": True}
        answer = self._take(key, request.path, body)
        if answer.get("order", True) is None:
            return 200, answer  # nothing has changed, so the key can be used again
        self._append(_Event(key=key, path=request.path, body=body))
        return 201, answer

    @staticmethod
    def _method(request: Request, method: str) -> None:
        if request.method != method:
            raise Problem(405, f"{request.path} takes {method}")

    def _take(self, key: str, path: str, body: str) -> dict[str, Any]:
        try:
            answer = {"key": key, **self._DO[path](self, body)}
        except msgspec.DecodeError as e:
            raise Problem(422, str(e)) from e
        if answer.get("order", True) is not None:
            self.taken[key] = (path, body, answer)
        return answer

    def _next_order(self, body: str) -> dict[str, Any]:
        station = msgspec.json.decode(body, type=_OrderRequest).station
        for order in self.orders.values():
            if not order.station and not order.closed:
                order.station = station
                return {"order": order.to_json()}
        return {"order": None}

    def _result(self, body: str) -> dict[str, Any]:
        result = msgspec.json.decode(body, type=_Result)
        self._find(result.order)
        self.results.append(msgspec.structs.asdict(result))
        return {"number": len(self.results)}

    def _close_order(self, body: str) -> dict[str, Any]:
        closing = msgspec.json.decode(body, type=_Closing)
        self._find(closing.order).closed = True
        return {}

    _DO: Final = {"/orders/next": _next_order, "/results": _result, "/orders/close": _close_order}

    def _find(self, order: str) -> Order:
        if order not in self.orders:
            raise Problem(404, f"order {order} does not exist")
        if order in self.forbidden:
            raise Problem(422, f"the order {order} is forbidden")
        return self.orders[order]

    # -------------------------------------------------------------------------------- storage
    def _append(self, event: _Event) -> None:
        if self._store is not None:
            self._store.write(msgspec.json.encode(event) + b"\n")
            self._store.flush()
            os.fsync(self._store.fileno())

    def _replay(self, event: _Event) -> None:
        if event.order is not None:
            self.orders[event.order.id] = event.order
        else:
            self._take(event.key, event.path, event.body)
