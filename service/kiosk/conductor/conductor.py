"""Moves visits along: says to the machine what happens, and does what it wants done.

All of it runs in one event loop. The machine is never asked by two at once, and nothing here waits:
what takes time is a task, and its answer an event that carries the number of its visit.
"""

import asyncio
import time
from collections.abc import Callable, Coroutine
from dataclasses import dataclass
from typing import Any

import structlog
from starlette.websockets import WebSocket

from denseface.service.errors import ServiceError
from denseface.service.kiosk.conductor.capturing import ShownFace, take_picture
from denseface.service.kiosk.conductor.figures import Figures
from denseface.service.kiosk.conductor.kept_withdrawals import KeptWithdrawals
from denseface.service.kiosk.conductor.mirror_feed import MirrorFeed
from denseface.service.kiosk.conductor.page import Page
from denseface.service.kiosk.conductor.ports import Hub, LinkMaker
from denseface.service.kiosk.page_messages import (
    Begin,
    Drawn,
    FaceHead,
    FromPage,
    Hello,
    MirrorHead,
    Next,
    Press,
    ResultScreen,
    ScreenName,
)
from denseface.service.kiosk.visit.effects import (
    Effect,
    MakeLinks,
    Mirror,
    TakePicture,
    Withdraw,
)
from denseface.service.kiosk.visit.events import (
    Event,
    FaceCame,
    HintCame,
    LinksFailed,
    LinksMade,
    PageCame,
    PageWent,
    ServiceIs,
    Withdrawn,
)
from denseface.service.kiosk.visit.machine import Kiosk
from denseface.service.protocol.hint import Hint

__all__ = ["Conductor", "ConductorOptions"]

_MAX_PAGES = 8
"""Pages at a time: a further one is turned away."""
_WITHDRAW_S = 5.0
"""Longest wait for the hub's answer to one request to withdraw, seconds."""
_AGAIN_S = 2.0
"""Time until a withdrawal of an earlier run is asked for again, seconds."""
_LOOK_S = 0.05
"""Time between two looks whether all is removed when it stops, seconds."""
_log = structlog.get_logger("kiosk")


@dataclass(frozen=True)
class ConductorOptions:
    """What the operator has set."""

    hello: Hello
    sensor: str | None = None
    """The one above the screen."""
    measurements: bool = False
    """Whether lengths on the face are shown."""


class Conductor:
    """Owns the kiosk's machine, its pages and what is under way for a visit.

    Parameters
    ----------
    kiosk : the machine, by the clock
    links : None where faces cannot be fetched
    clock : seconds; that of the event loop
    """

    def __init__(
        self, kiosk: Kiosk, hub: Hub, kept: KeptWithdrawals, options: ConductorOptions,
        links: LinkMaker | None = None, clock: Callable[[], float] = time.monotonic,
    ) -> None:
        self._kiosk, self._hub, self._kept = kiosk, hub, kept
        self._options, self._links, self._clock = options, links, clock
        self.figures = Figures()
        self._pages: list[Page] = []
        self._holder: Page | None = None
        """The page that has the visit."""
        self._language = options.hello.languages[0]
        """In which the visitor reads."""
        self._mirror = MirrorFeed(hub, options.sensor, self._give_mirror, self._hint)
        self._tasks: set[asyncio.Task[None]] = set()
        self._withdrawing: dict[str, int | None] = {}
        """Captures that are being removed, and the visit that is to be told; None for none."""
        self._timer: asyncio.TimerHandle | None = None

    # --- pages

    async def page(self, socket: WebSocket) -> None:
        """Serve a page's WebSocket until it ends."""
        await socket.accept()
        if len(self._pages) >= _MAX_PAGES:
            self.figures.pages["turned_away"] += 1
            await socket.close(1013)
            return
        page = Page(socket, self._clock)
        self._pages.append(page)
        self.figures.pages["opened"] += 1
        self._happened(PageCame())
        try:
            await page.serve(self._options.hello, lambda said: self.heard(page, said))
        finally:
            self._pages.remove(page)
            if page is self._holder:
                self._holder = None
                self._happened(PageWent(self._kiosk.visit))

    def heard(self, page: Page, said: FromPage) -> None:
        """Take what a page says; of a page that has not the visit only that it begins one."""
        if not self._kiosk.busy and isinstance(said, Begin | Press):
            self._holder = page
        if page is not self._holder:
            return
        if said.visit == self._kiosk.visit:
            if isinstance(said, Next):
                self._mirror.next()
            elif isinstance(said, Drawn):
                self._drawn(said)
        if said.kind == "consent":
            self._language = said.language
        self._step(self._kiosk.page(said, self._clock()))

    def button(self) -> None:
        """Take a press of the button beside the screen: of the visit, else of the first page."""
        page = self._holder or (self._pages[0] if self._pages else None)
        if page is not None:
            self.heard(page, Press(visit=self._kiosk.visit))

    # --- what happens

    def service_is(self, event: ServiceIs) -> None:
        """Take how the hub is."""
        self._happened(event)

    def _hint(self, hint: Hint) -> None:
        self._happened(HintCame(hint, self._kiosk.visit))

    def _give_mirror(self, head: MirrorHead, jpeg: bytes) -> None:
        if self._holder is not None:
            self._holder.show_mirror(head, jpeg)

    def _drawn(self, said: Drawn) -> None:
        waited_ms = self.figures.drawn(said.capture_id, self._clock())
        if waited_ms is not None:
            _log.info("face shown", visit=said.visit, exposure_to_drawn_ms=round(waited_ms))

    def _happened(self, event: Event) -> None:
        self._step(self._kiosk.happened(event, self._clock()))

    def _due(self) -> None:
        self._step(self._kiosk.tick(self._clock()))

    def _step(self, effects: list[Effect]) -> None:
        """Do what is wanted, show what is to be shown, wait for what is due next."""
        for effect in effects:
            self._do(effect)
        now = self._clock()
        screen = self._kiosk.screen(now)
        if screen.name is ScreenName.ATTRACT:
            if self._holder is not None:
                self._holder.forget()
            self._holder = None
        for page in self._pages:
            page.show(screen if self._holder in (None, page) else self._kiosk.busy_screen())
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if (at := self._kiosk.next_at_s) is not None:
            # A moment later, not earlier: what is not yet due would be asked for again and again.
            self._timer = asyncio.get_running_loop().call_later(
                max(at - now, 0.0) + 0.001, self._due)

    # --- what is wanted

    def _do(self, effect: Effect) -> None:
        match effect:
            case Mirror(on=True):
                self._mirror.start()
            case Mirror():
                self._mirror.stop()
            case TakePicture():
                self._start(self._take(effect))
            case Withdraw():
                self._withdraw(effect.capture_id, effect.visit)
            case MakeLinks():
                self._start(self._make_links(effect))

    async def _take(self, effect: TakePicture) -> None:
        shown = await take_picture(
            self._hub, self._options.sensor, effect, self._happened, self._withdraw, self._clock,
            measured=self._options.measurements)
        if shown is None:
            return
        now = self._clock()
        effects = self._kiosk.happened(
            FaceCame(effect.visit, effect.capture_id, self._result(effect, shown)), now)
        result = self._kiosk.screen(now).result
        if result is not None and result.capture_id == effect.capture_id and self._holder:
            self.figures.exposed(effect.capture_id, shown.exposed_s)
            self._holder.show_face(
                FaceHead(capture_id=effect.capture_id, visit=effect.visit), shown.grid)
        self._step(effects)

    def _result(self, effect: TakePicture, shown: ShownFace) -> ResultScreen:
        return ResultScreen(
            capture_id=effect.capture_id, initial_points=len(shown.face.initial),
            dense_points=len(shown.face.dense), measurements=shown.measured,
            can_keep=self._links is not None and self._links.reachable)

    async def _make_links(self, effect: MakeLinks) -> None:
        if self._links is None:
            return
        try:
            keep = await self._links.make(effect.capture_id, self._language)
        except ServiceError as error:
            _log.warning("no links", reason=str(error))
            self._happened(LinksFailed(effect.visit, effect.capture_id))
            return
        self._happened(LinksMade(effect.visit, effect.capture_id, keep))

    def _withdraw(self, capture_id: str, visit: int | None = None) -> None:
        """Have a capture removed; while that is asked for it is not asked for a second time."""
        told = self._withdrawing.get(capture_id)
        under_way = capture_id in self._withdrawing
        self._withdrawing[capture_id] = told if visit is None else visit
        if not under_way:
            self._kept.begin(capture_id)
            self._start(self._remove(capture_id))

    async def _remove(self, capture_id: str) -> None:
        """Remove a capture, its links first; ask until the hub has answered."""
        while True:
            try:
                if self._links is not None:
                    await self._links.forget(capture_id)
                await self._hub.withdraw(capture_id, timeout=_WITHDRAW_S)
            except ServiceError as error:
                _log.warning("not removed yet", reason=str(error))
                await asyncio.sleep(_AGAIN_S)
            else:
                break
        self._kept.end(capture_id)
        visit = self._withdrawing.pop(capture_id)
        if visit is not None:
            self._happened(Withdrawn(visit, capture_id))

    # --- beginning and end

    def start(self) -> None:
        """Go on with the withdrawals of earlier runs."""
        for capture_id in self._kept.pending():
            self._withdraw(capture_id)

    async def close(self, seconds: float) -> None:
        """Stop; what is being withdrawn has so many seconds, the next start does the rest."""
        self._mirror.stop()
        until = time.monotonic() + seconds
        while self._withdrawing and time.monotonic() < until:
            await asyncio.sleep(_LOOK_S)
        if self._timer is not None:
            self._timer.cancel()
        for task in (tasks := list(self._tasks)):
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def _start(self, work: Coroutine[Any, Any, None]) -> "asyncio.Task[None]":
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._ended)
        return task

    def _ended(self, task: "asyncio.Task[None]") -> None:
        self._tasks.discard(task)
        if not task.cancelled() and (error := task.exception()) is not None:
            _log.error("a task failed", exc_info=error)
