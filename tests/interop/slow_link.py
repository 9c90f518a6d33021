"""A link between two computers that takes its time, loses packets and can be cut, for what speaks TCP.

TCP hides a lost packet behind a pause: the sender waits and sends it again, and all that is behind it
waits too. So a loss is a pause here, as long as Linux waits at least, and nothing overtakes it.
"""

import asyncio
import random
import threading

PACKET_BYTES = 1448
RETRANSMITTED_AFTER_S = 0.2


class Link:
    """Passes on what is sent to `port` to another port of this host."""

    def __init__(self, to_port, delay_s=0.0, loss=0.0, seed=1):
        self.to_port, self.delay_s, self.loss = to_port, delay_s, loss
        self._random = random.Random(seed)
        self._is_cut = False
        self._tasks = set()
        self.lost = self.passed = 0
        self._loop = asyncio.new_event_loop()
        self._thread = threading.Thread(target=self._loop.run_forever, daemon=True)
        self._thread.start()
        self._server = self._on_loop(asyncio.start_server(self._accepted, '127.0.0.1', 0))
        self.port = self._server.sockets[0].getsockname()[1]

    def _on_loop(self, coroutine):
        return asyncio.run_coroutine_threadsafe(coroutine, self._loop).result()

    async def _accepted(self, reader, writer):
        if self._is_cut:
            return
        try:
            to_reader, to_writer = await asyncio.open_connection('127.0.0.1', self.to_port)
        except OSError:
            writer.close()
            return
        for source, target in ((reader, to_writer), (to_reader, writer)):
            packets = asyncio.Queue()
            for work in (self._take(source, packets), self._deliver(packets, target)):
                task = asyncio.ensure_future(work)
                self._tasks.add(task)
                task.add_done_callback(self._tasks.discard)

    async def _take(self, source, packets):
        free_at = 0.0
        while data := await source.read(PACKET_BYTES):
            due = self._loop.time() + self.delay_s
            self.passed += 1
            if self._random.random() < self.loss:
                self.lost += 1
                due += RETRANSMITTED_AFTER_S
            free_at = max(free_at, due)
            packets.put_nowait((free_at, data))
        packets.put_nowait((free_at, b''))

    async def _deliver(self, packets, target):
        try:
            while True:
                due, data = await packets.get()
                await asyncio.sleep(due - self._loop.time())
                while self._is_cut:
                    await asyncio.sleep(0.01)
                if not data:
                    break
                target.write(data)
                await target.drain()
        except OSError:
            pass
        finally:
            target.close()

    def cut(self):
        """Nothing passes any more, and neither side is told, as when a cable is pulled."""
        self._is_cut = True

    def mend(self):
        """The cable is back. What both sides did not give up goes on; the rest connects anew."""
        self._is_cut = False

    def close(self):
        async def stop():
            self._server.close()
            for task in list(self._tasks):
                task.cancel()
            await asyncio.gather(*self._tasks, return_exceptions=True)
        self._on_loop(stop())
        self._loop.call_soon_threadsafe(self._loop.stop)
        self._thread.join()
        self._loop.close()
