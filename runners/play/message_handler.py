"""Answers to the messages of the page. This module knows nothing of sockets, so it can be tested without one."""

from __future__ import annotations

import json
import traceback
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

from lme.config.composer import SHIPPED
from lme.errors import InputError
from lme.inputs.user_code import show_traceback, user_error
from lme.types import Pose
from runners.play.drawing import FARTHEST, item_of
from runners.play.page_input import Fields, changed, map_files
from runners.play.page_messages import LAYERS, Sender, detail_message, options, situation, world_message
from runners.play.saving import SAVERS, save
from runners.play.session import MOST_STEPS, Session
from runners.play.setups import setup_of, try_words

Reply = str | bytes  # JSON text, or a binary message

BUDGET_S = 0.02  # of computing per message, so that the next one is read soon
BATCH = 100  # frames in one message, at most
_NOTHING = -1  # known revision of a page that has been sent nothing


class MessageHandler:
    """A session, and what its page has already been sent."""

    def __init__(self, session: Session, root: Path = Path()) -> None:
        """Serve the session. root: the folder in which files may be read and written."""
        self.session, self._root = session, root.resolve()
        self._senders: list[Sender] = []
        self._replies: list[Reply] = []  # replies that a message asked for
        self._sent_revision = _NOTHING  # revision that the page knows
        self._worlds: set[int] = set()  # steps at which a world begins that the page knows

    def welcome(self) -> Iterator[Reply]:
        """Yield everything that a newly opened page needs."""
        self._sent_revision, self._senders, self._worlds = _NOTHING, [], set()
        source = self.session.script.setup.source
        folders = (*SHIPPED, *([source.config_dir] if source and source.config_dir else []))
        yield json.dumps(options(folders, map_files(self._root)))
        yield from self._changes()

    def answer(self, text: str) -> Iterator[Reply]:
        """Yield the replies to a message.

        A mistake in the message yields a reply of the type "error", and the session stays as it was.
        """
        ticket: Any = None
        # Whatever the message does is taken back if it fails.
        previous_state = self.session.state()
        try:
            fields = Fields(text)
            ticket = fields.value("ticket")
            _ANSWERS[fields.one_of("type", _ANSWERS)](self, fields)
            news = list(self._changes())
        except (Exception, SystemExit) as error:  # whatever fails, the page goes on
            yield json.dumps({"type": "error", "text": _explain_error(error)})
            if self.session.revision != previous_state["revision"]:  # the page has not been sent the change
                self._sent_revision = _NOTHING
            self.session.restore(previous_state)
            news, self._replies = list(self._changes()), []
        # Send the change itself first, then what the message asked for.
        yield from news
        yield from self._replies
        self._replies = []
        if ticket is not None:
            yield json.dumps({"type": "done", "ticket": ticket})

    def _changes(self) -> Iterator[Reply]:
        """Yield what the page does not know yet."""
        session = self.session
        sent_revision = self._sent_revision
        if sent_revision != session.revision:
            yield from self._situation()
        for number, (lane, sender) in enumerate(zip(session.lanes, self._senders, strict=True)):
            header = {"type": "frames", "revision": session.revision, "lane": number}
            while sender.sent < len(lane.frames):
                yield sender.frames(lane, min(sender.sent + BATCH, len(lane.frames)), header)
        if sent_revision != session.revision:
            yield json.dumps({"type": "settled"})  # all parts of the drawing are consistent again

    def _situation(self) -> Iterator[Reply]:
        # The page keeps its frames and worlds only if it knows the revision before this one.
        session = self.session
        num_kept = session.kept if self._sent_revision == session.revision - 1 else 0
        if num_kept == 0:
            self._senders, self._worlds = [Sender() for _ in session.lanes], set()
        for sender in self._senders:
            sender.forget(num_kept)
        self._sent_revision = session.revision
        self._worlds = {step for step in self._worlds if step < num_kept}
        # Send the situation, then every world that the page has lost or never had.
        yield json.dumps(situation(session, num_kept))
        for step, drawing in sorted(session.script.drawings.items()):
            if step not in self._worlds:
                self._worlds.add(step)
                yield world_message(drawing, {"type": "world", "revision": session.revision, "step": step})

    def _advance(self, fields: Fields) -> None:
        self.session.advance(fields.integer("until", MOST_STEPS), BUDGET_S)

    def _put(self, fields: Fields) -> None:
        item = item_of(fields.text("kind"), fields.mapping("entry"))
        self.session.put(self._step(fields), fields.text("name"), item, fields.text("gesture", ""))

    def _erase(self, fields: Fields) -> None:
        self.session.erase(self._step(fields), fields.text("name"), fields.text("gesture", ""))

    def _goal(self, fields: Fields) -> None:
        x, y = fields.numbers("goal", 2, FARTHEST)
        self.session.move_goal(self._step(fields), (x, y), fields.text("gesture", ""))

    def _start(self, fields: Fields) -> None:
        pose = Pose(*fields.numbers("start", 3, FARTHEST))
        self.session.move_start(self._step(fields), pose, fields.text("gesture", ""))

    def _words(self, fields: Fields) -> None:
        """Change words of the command line: {"set": {key: value, or null to remove the word}}."""
        setup, changes = self.session.script.setup, fields.mapping("set")
        if setup.source is None:
            raise InputError(
                "a recording drives with its own config alone; open the run's directory to change it"
            )
        words = changed(setup.source.words, changes, self._root)
        source = replace(setup.source, words=tuple(words))
        try_words(source, changes)
        self.session.choose(setup_of(source, former=setup), self._step(fields))

    def _detail(self, fields: Fields) -> None:
        """Reply with the details behind a decision."""
        session = self.session
        lane = fields.integer("lane", len(session.lanes) - 1)
        step = min(self._step(fields), len(session.lanes[lane].frames) - 1)
        layers = fields.some_of("layers", LAYERS)
        header = {
            "type": "detail",
            "revision": session.revision,
            "lane": lane,
            "step": step,
            "layers": layers,
        }
        self._replies.append(detail_message(session.lanes[lane], step, session.tasks, layers, header))

    def _save(self, fields: Fields) -> None:
        """Save the session as a file of the requested kind, and reply with its path."""
        kind = fields.one_of("kind", SAVERS)
        saved = save(self.session, kind, fields.text("name"), self._root, self._step(fields))
        self._replies.append(json.dumps({"type": "saved", "path": str(saved.path), "command": saved.command}))

    def _clear(self, fields: Fields) -> None:
        self.session.clear(self._step(fields))

    def _reset(self, fields: Fields) -> None:
        self.session.reset()

    def _undo(self, fields: Fields) -> None:
        self.session.undo()

    def _redo(self, fields: Fields) -> None:
        self.session.redo()

    def _step(self, fields: Fields) -> int:
        return fields.integer("step", MOST_STEPS)


def _explain_error(error: BaseException) -> str:
    """Return one line about an error. An error in lme itself is printed in full on the terminal."""
    if isinstance(error, InputError):
        return str(error)
    users = user_error(error)
    if users:
        show_traceback(error)
        return users
    traceback.print_exception(error)
    return f"{type(error).__name__}: {error}"


_ANSWERS: dict[str, Callable[[MessageHandler, Fields], None]] = {
    "advance": MessageHandler._advance,
    "put": MessageHandler._put,
    "erase": MessageHandler._erase,
    "goal": MessageHandler._goal,
    "start": MessageHandler._start,
    "words": MessageHandler._words,
    "detail": MessageHandler._detail,
    "save": MessageHandler._save,
    "clear": MessageHandler._clear,
    "reset": MessageHandler._reset,
    "undo": MessageHandler._undo,
    "redo": MessageHandler._redo,
}
