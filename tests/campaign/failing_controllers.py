"""Controllers that fail or misbehave: agent 1's, from 0.2 s on. All hover."""

import os
import signal
import sys
import threading
import time
from typing import Any, NoReturn

from agent.controller import Intent, Senses
from agent.setup import AgentSetup

AT_S = 0.2


class Hovers:
    """Does nothing wrong."""

    def __init__(self, setup: AgentSetup) -> None:
        self.agent = setup.id
        self.begun = False

    def fail(self) -> Any: ...

    def decide(self, senses: Senses) -> Intent:
        if self.agent == 1 and senses.now_s > AT_S:
            self.fail()
        zero = (0.0, 0.0, 0.0)
        return Intent(zero, zero, senses.yaw, 0.0, senses.position)


class Once(Hovers):
    """Misbehaves once and flies on."""

    def fail(self) -> None:
        if not self.begun:
            self.begun = True
            self.misbehave()

    def misbehave(self) -> None: ...


class Exit0(Hovers):
    def fail(self) -> NoReturn:
        sys.exit(0)


class Exit0WhenMade(Hovers):
    def __init__(self, setup: AgentSetup) -> None:
        super().__init__(setup)
        if setup.id == 1:
            sys.exit(0)


class OsExit0(Hovers):
    def fail(self) -> NoReturn:
        os._exit(0)


class OsExit0WhenMade(Hovers):
    def __init__(self, setup: AgentSetup) -> None:
        super().__init__(setup)
        if setup.id == 1:
            os._exit(0)


class Interrupts(Hovers):
    def fail(self) -> NoReturn:
        raise KeyboardInterrupt


class ExitsGenerator(Hovers):
    def fail(self) -> NoReturn:
        raise GeneratorExit("x")


class OwnBaseError(Hovers):
    class StrangeError(BaseException):
        pass

    def fail(self) -> NoReturn:
        raise self.StrangeError("odd")


class KillsItself(Hovers):
    def fail(self) -> None:
        os.kill(os.getpid(), signal.SIGKILL)


class Aborts(Hovers):
    def fail(self) -> NoReturn:
        os.abort()


class Recurses(Hovers):
    def fail(self) -> Any:
        return self.fail()


class OverflowsTheStack(Hovers):
    def fail(self) -> Any:
        sys.setrecursionlimit(10**9)
        return eval("(" * 50 + "self.fail()" + ")" * 50, {"self": self})


class NulText(Hovers):
    def fail(self) -> NoReturn:
        raise ValueError("a\0b\nc")


class EatsMemory(Hovers):
    def fail(self) -> NoReturn:
        hoard = []
        while True:
            hoard.append(bytearray(200_000_000))


class HoardsMemory(Hovers):
    """Keeps what it has eaten, so that nothing is left for the report."""

    def fail(self) -> None:
        self.hoard = [bytearray(200_000_000)]
        size = 100_000_000
        while size > 10:
            try:
                self.hoard.append(bytearray(size))
            except MemoryError:
                size //= 2
        raise ValueError("enough")


class ClosesFiles(Hovers):
    def fail(self) -> None:
        os.closerange(0, 200)


class NoText(Hovers):
    class NoTextError(Exception):
        def __str__(self) -> str:
            raise RuntimeError("no text")

    def fail(self) -> NoReturn:
        raise self.NoTextError


class Escapes(Hovers):
    def fail(self) -> NoReturn:
        raise ValueError("\x1b]0;title\x07\x1b[31mRED\nline 2 \udc80 \u202e\x9b end")


class NotFinite(Hovers):
    def decide(self, senses: Senses) -> Intent:
        bad = (float("nan"), 0.0, 0.0)
        return Intent(bad, bad, senses.yaw, 0.0, senses.position)


class Blocks(Hovers):
    def fail(self) -> None:
        signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGTERM, signal.SIGINT})
        time.sleep(1e6)


class Spins(Hovers):
    def fail(self) -> NoReturn:
        while True:
            pass


class Forks(Once):
    """Its child lives on, and holds every file open."""

    def misbehave(self) -> None:
        pid = os.fork()
        if pid == 0:
            time.sleep(600.0)
            os._exit(0)
        print(f"forked {pid}")


class ForksTwice(Once):
    """Its grandchild loses its parent, as a daemon does."""

    def misbehave(self) -> None:
        read_end, write_end = os.pipe()
        if os.fork() == 0:
            signal.signal(signal.SIGHUP, signal.SIG_IGN)
            os.setsid()
            pid = os.posix_spawn("/bin/sleep", ["sleep", "600"], {})
            os.write(write_end, str(pid).encode())
            os._exit(0)
        print(f"forked {os.read(read_end, 20).decode()}")


class ForksACopy(Once):
    """Its child goes on as if it were the run."""

    def misbehave(self) -> None:
        os.fork()


class ChangesFolder(Once):
    def misbehave(self) -> None:
        os.chdir("/")


class StartsAThread(Once):
    def misbehave(self) -> None:
        threading.Thread(target=time.sleep, args=(600.0,)).start()


class IgnoresSignals(Once):
    def misbehave(self) -> None:
        for number in (signal.SIGTERM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, signal.SIG_IGN)
        print("deaf", flush=True)


class Breaks(Once):
    def misbehave(self) -> None:
        answer = 6 * 7
        breakpoint()
        print("agent", self.agent, answer)


class TakesSome(Hovers):
    def decide(self, senses: Senses) -> Intent:
        assert len(bytearray(100 * 1024**2)) > 0
        return super().decide(senses)


class Prints(Hovers):
    def decide(self, senses: Senses) -> Intent:
        print("x" * 100_000)
        sys.stderr.write("\u00e9" * 100_000)
        return super().decide(senses)
