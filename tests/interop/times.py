"""Round trips, holds and a long path on each middleware, against bare nodes of the same library.

Run by `.ci/times`, which has the environment of each middleware:

    .ci/times KERF FOLDER [--calls 500] [--holds 100] [--paths 100000x3,1000000x1]

No test. In turn with each call to a node of Kerf the same call goes to a bare node in a process of
its own, of the same library as the caller. All times are of `time.perf_counter` of the caller, but
the write of `!`: that has the wall clock of the driver's journal in the bag.
"""

import argparse
import hashlib
import json
import math
import os
import random
import subprocess
import sys
import time
import traceback
import zlib
from pathlib import Path

from machine import Machine, die_with_parent
from middlewares import NODES, RMW, Where, router

# Calls before the first that counts.
WARM_UP = 20
BAUD = 115_200
# The nodes publish the chunks of a new path at this pace; then they are at rest.
ELEMENTS_PER_S = 30_000
BARE = 'bare/'


def main():
    parser = argparse.ArgumentParser(description=__doc__.split('\n')[0])
    roles = parser.add_subparsers(required=True)
    role = roles.add_parser('measure')
    role.add_argument('middleware', choices=NODES)
    role.add_argument('out', type=Path)
    role.add_argument('--calls', type=int, default=500)
    role.add_argument('--holds', type=int, default=100)
    role.add_argument('--lines', type=int, default=100_000, help='of the program that is held')
    role.add_argument('--paths', default='100000x3,1000000x1', help='elements, and how often each')
    role.add_argument('--also', action='store_true', help='add to the figures that the file has')
    role.set_defaults(run=measure)
    role = roles.add_parser('table')
    role.add_argument('files', type=Path, nargs='+')
    role.set_defaults(run=lambda arguments: print(table(
        [json.loads(file.read_text()) for file in arguments.files])))
    for name, run in (('bare', serve), ('late', join_late)):
        role = roles.add_parser(name)
        role.add_argument('middleware', choices=NODES)
        role.add_argument('namespace')
        role.add_argument('domain_id', type=int)
        role.add_argument('port', type=int)
        role.add_argument('prefix')
        role.set_defaults(run=run)
    arguments = parser.parse_args()
    arguments.run(arguments)


def load_of_host():
    return float(Path('/proc/loadavg').read_text().split()[0])


def say(text):
    print(f'{time.strftime("%H:%M:%S")} load {load_of_host():.1f}: {text}', file=sys.stderr, flush=True)


class Measured:
    """All that is measured on one middleware."""

    def __init__(self, middleware, out):
        self._out = out
        self.results = {'middleware': middleware, 'loads': [], 'failures': [],
                        'round_trip': {}, 'hold': {}, 'path': {}}

    def keep(self):
        self._out.write_text(json.dumps(self.results))

    def series(self, part, name):
        return self.results[part].setdefault(name, [])

    def attempt(self, what, act):
        """The result of `act`, or None: what fails is a result, too."""
        try:
            return act()
        except Exception as failure:
            say(f'FAILED: {what}: {failure}')
            self.results['failures'].append(
                {'what': what, 'why': str(failure)[-2000:], 'where': traceback.format_exc()[-2000:]})
            return None

    def timed(self, part, name, call):
        """Calls, and keeps the time in ms; the answer, or None."""
        begin = time.perf_counter()
        answer = self.attempt(f'{part} {name}', call)
        if answer is not None:
            self.series(part, name).append((time.perf_counter() - begin) * 1e3)
        return answer


def measure(arguments):
    middleware = arguments.middleware
    made = Measured(middleware, arguments.out)
    if arguments.also:
        made.results = json.loads(arguments.out.read_text())
    made.results.setdefault('begin', time.strftime('%Y-%m-%d %H:%M'))
    with router(middleware) as (port, variables):
        machine = Machine(time_factor=1, rmw=RMW[middleware], variables=variables)
        where = Where(machine.namespace, machine.domain_id, port)
        try:
            rig = Rig(made, machine, where, middleware)
            with rig.bare('0'):
                if arguments.calls:
                    rig.round_trips(arguments.calls)
                if arguments.holds:
                    rig.holds(arguments.holds, rig.load(arguments.lines))
            for words in filter(None, arguments.paths.split(',')):
                elements, times = map(int, words.split('x'))
                rig.load(elements)
                with rig.bare(str(elements)):
                    rig.paths(elements, times)
        except Exception:
            (arguments.out.with_suffix('.log')).write_text(machine.log())
            raise
        finally:
            made.results['loads'].append(load_of_host())
            made.keep()
            machine.stop()
    os._exit(0)


class Rig:
    """A machine, and how each thing is measured on it."""

    def __init__(self, made, machine, where, middleware):
        self.made, self.machine, self.where, self.middleware = made, machine, where, middleware
        self.until_idle()
        self.caller = NODES[middleware]('cell', where)

    def child(self, role, prefix):
        words = [role, self.middleware, self.where.namespace, self.where.domain_id, self.where.port, prefix]
        return subprocess.Popen(
            [sys.executable, '-B', __file__, *map(str, words)], stdout=subprocess.PIPE, text=True,
            preexec_fn=die_with_parent)

    def bare(self, elements):
        """A bare node in a process of its own, ready."""
        child = self.child('bare', elements)
        assert child.stdout.readline() == 'ready\n', 'the bare node does not start'
        return Ended(child)

    def until_idle(self):
        node = NODES[self.middleware]('looks_on', self.where)
        state = node.type('cnc_msgs/msg/MachineState')
        node.latched('cnc_msgs/msg/MachineState', 'machine_state',
                     lambda it: it.state == state.STATE_IDLE)
        node.close()

    def load(self, lines):
        """Loads a program of so many lines and waits until the driver has its path."""
        name = f'{lines}.ngc'
        self.machine.file(name, short_lines(lines))
        here = self.machine.log().count('received the path of ')
        begin = time.monotonic()
        answer = self.caller.caller('cnc_msgs/srv/LoadProgram', 'load_program')(
            within=300, path=str(self.machine.folder / name))
        assert answer.success, answer.message
        while self.machine.log().count('received the path of ') == here:
            assert time.monotonic() - begin < 300, 'the driver has no path'
            time.sleep(0.05)
        say(f'{lines} lines loaded, planned, and with the driver: {time.monotonic() - begin:.1f} s')
        # The chunks are published meanwhile; nothing of that is measured.
        time.sleep(2 + lines / ELEMENTS_PER_S)
        return answer.program_id

    def round_trips(self, calls):
        services = {'kerf': 'axis_driver/get_parameters', 'bare': f'{BARE}get_parameters'}
        callers = {name: self.caller.caller('rcl_interfaces/srv/GetParameters', service)
                   for name, service in services.items()}
        self.note_load()
        for number in range(-WARM_UP, calls):
            for name, call in callers.items():
                if number < 0:
                    call(names=['baud'])
                    continue
                answer = self.made.timed('round_trip', name, lambda call=call: call(names=['baud']))
                assert answer is None or answer.values[0].integer_value == BAUD
        self.say_series('round_trip')

    def holds(self, count, program_id):
        hold, resume, bare = (self.caller.caller('std_srvs/srv/Trigger', name)
                              for name in ('feed_hold', 'resume', f'{BARE}feed_hold'))
        cancel = self.caller.caller('std_srvs/srv/Trigger', 'cancel')
        # A node of its own, which nobody spins: feedback is not part of the times.
        NODES[self.middleware]('runs', self.where).start_run(program_id)
        time.sleep(2)
        pauses = random.Random(1)
        begins = []
        for _ in range(WARM_UP):
            bare()
        self.note_load()
        for _ in range(count):
            self.made.timed('hold', 'bare', bare)
            begins.append(time.time_ns())
            self.made.timed('hold', 'answer', lambda: done(hold()))
            end = time.monotonic() + 60
            while not (answer := resume()).success:
                assert time.monotonic() < end, answer.message
                time.sleep(0.02)
            # The line is full again; holds must not be periodic.
            time.sleep(pauses.uniform(0.06, 0.124))
        cancel()
        end = time.monotonic() + 60
        while 'is complete' not in self.machine.log():
            assert time.monotonic() < end, 'the bag is not complete'
            time.sleep(0.1)
        [bag] = (self.machine.folder / 'bags').glob('run_*')
        self.made.attempt('read the bag', lambda: self.to_write(bag, begins))
        self.say_series('hold')

    def to_write(self, bag, begins):
        """The time from each call to the first `!` after it, by the journal in the bag."""
        written = holds_written(bag)
        for begin, end in zip(begins, [*begins[1:], math.inf]):
            first = next((at for at in written if begin < at < end), None)
            if self.made.attempt('a hold in the bag', lambda it=first: known(it)):
                self.made.series('hold', 'written').append((first - begin) / 1e6)

    def paths(self, elements, times):
        self.note_load()
        kinds = self.made.results['path'].setdefault(str(elements), {'kerf': [], 'bare': []})
        for _ in range(times):
            for name, prefix in (('kerf', '-'), ('bare', BARE)):
                joined = self.made.attempt(f'path of {elements}, {name}', lambda p=prefix: self.late(p))
                if joined is not None:
                    assert joined['elements'] >= elements, joined
                    kinds[name].append(joined)
                    say(f'path of {elements}, {name}: {joined}')
                    self.made.keep()

    def late(self, prefix):
        with Ended(self.child('late', prefix)) as child:
            said = child.stdout.read()
            assert child.wait() == 0, 'the late joiner failed'
        return json.loads(said)

    def note_load(self):
        self.made.results['loads'].append(load_of_host())

    def say_series(self, part):
        for name, series in self.made.results[part].items():
            say(f'{part} {name}: {len(series)} times, p50 {quantile(series, 0.5):.3f} ms, '
                f'p99 {quantile(series, 0.99):.3f} ms, most {max(series):.3f} ms')


def done(answer):
    assert answer.success, answer.message
    return answer


def known(written):
    assert written, 'no `!` between this call and the next'
    return written


class Ended:
    """A child that ends with its block."""

    def __init__(self, child):
        self.child = child

    def __enter__(self):
        return self.child

    def __exit__(self, *_):
        self.child.kill()
        self.child.wait()


def short_lines(lines, length_mm=0.4):
    """A spiral outwards, in lines that are shorter than the serial line is fast."""
    text, angle = ['G21 G17 G90 G94 G40\nG0 X0 Y0\nG1 F24000\n'], 0.0
    for number in range(lines):
        radius = 20 + number * 2e-4
        angle += length_mm / radius
        text.append(f'X{radius * math.cos(angle):.3f} Y{radius * math.sin(angle):.3f}\n')
    return ''.join([*text, 'M2\n'])


def holds_written(bag):
    """When the driver wrote `!`, in nanoseconds since the epoch."""
    from rosbags.highlevel import AnyReader
    entries = []
    with AnyReader([bag]) as reader:
        wanted = [it for it in reader.connections if it.topic.endswith('/controller_traffic')]
        for connection, _, data in reader.messages(wanted):
            for entry in reader.deserialize(data, connection.msgtype).entries:
                if entry.kind == entry.KIND_TRANSMITTED and b'!' in bytes(entry.data):
                    entries.append((entry.sequence, entry.stamp.sec * 10**9 + entry.stamp.nanosec))
    return [at for _, at in sorted(set(entries))]


def serve(arguments):
    """The bare node: answers calls, and has a path of as many elements in chunks as long as Kerf's."""
    where = Where(arguments.namespace, arguments.domain_id, arguments.port)
    # Not `bare`: a node of rclpy has services of its own below its name.
    node = NODES[arguments.middleware]('answers', where)
    elements = int(arguments.prefix)
    value = node.type('rcl_interfaces/msg/ParameterValue')(type=2, integer_value=BAUD)
    answers = {name: node.type(name).Response for name in (
        'rcl_interfaces/srv/GetParameters', 'std_srvs/srv/Trigger', 'cnc_msgs/srv/GetPathChunks')}

    def service(type_name, name, handler):
        node.service(type_name, f'{BARE}{name}', handler)
    service('rcl_interfaces/srv/GetParameters', 'get_parameters',
            lambda _: answers['rcl_interfaces/srv/GetParameters'](values=[value]))
    service('std_srvs/srv/Trigger', 'feed_hold',
            lambda _: answers['std_srvs/srv/Trigger'](success=True))
    if elements:
        # A chunk from the middle of Kerf's path, over and over.
        get_chunks = node.caller('cnc_msgs/srv/GetPathChunks', 'compensated_path/get_chunks')
        [chunk] = get_chunks(first=1).chunks
        each = len(chunk.elements)
        count = math.ceil(elements / each)
        body = node.body(chunk)
        chunk.program_id, chunk.revision, chunk.chunk_count = 'bare', 1, count
        manifest = node.type('cnc_msgs/msg/CompensatedPath')(
            program_id='bare', revision=1, element_count=count * each, chunk_count=count,
            sha256=hashlib.sha256(body * count).hexdigest())

        def chunks(request):
            chunk.index, chunk.first_element = request.first, request.first * each
            return answers['cnc_msgs/srv/GetPathChunks'](success=True, chunks=[chunk])
        service('cnc_msgs/srv/GetPathChunks', 'compensated_path/get_chunks', chunks)
        node.latch('cnc_msgs/msg/CompensatedPath', f'{BARE}compensated_path', manifest)
    print('ready', flush=True)
    node.serve_forever()


def join_late(arguments):
    """A process that comes late for a path: prints when the manifest and the whole path had arrived."""
    where = Where(arguments.namespace, arguments.domain_id, arguments.port)
    prefix = arguments.prefix.strip('-')
    kind = NODES[arguments.middleware]
    kind.prepare('cnc_msgs/msg/CompensatedPath', 'cnc_msgs/srv/GetPathChunks')
    begin = time.perf_counter()
    node = kind('late', where)
    manifest = node.latched('cnc_msgs/msg/CompensatedPath', f'{prefix}compensated_path')
    with_manifest = time.perf_counter()
    get_chunks = node.caller('cnc_msgs/srv/GetPathChunks', f'{prefix}compensated_path/get_chunks')
    whole, elements, index, checking, size = hashlib.sha256(), 0, 0, 0.0, 0
    while index < manifest.chunk_count:
        answer = get_chunks(
            first=index, program_id=manifest.program_id, revision=manifest.revision)
        assert answer.success, answer.message
        arrived = time.perf_counter()
        for chunk in answer.chunks:
            assert (chunk.index, chunk.first_element) == (index, elements)
            body = node.body(chunk)
            assert zlib.crc32(body) == chunk.crc32, f'chunk {index} is damaged'
            whole.update(body)
            elements, index, size = elements + len(chunk.elements), index + 1, size + len(body)
        checking += time.perf_counter() - arrived
    assert elements == manifest.element_count
    assert whole.hexdigest() == manifest.sha256, 'the path is not whole'
    print(json.dumps({
        'manifest_s': with_manifest - begin, 'whole_s': time.perf_counter() - begin,
        'checking_s': checking, 'elements': elements, 'chunks': index, 'bytes': size}), flush=True)
    os._exit(0)


def quantile(series, part):
    """The smallest that this share of all does not exceed."""
    ordered = sorted(series)
    return ordered[max(math.ceil(part * len(ordered)), 1) - 1] if ordered else math.nan


def table(results):
    """One table; a pair of columns for each middleware."""
    titles = {'fastdds': 'Fast DDS', 'cyclone': 'Cyclone DDS', 'zenoh': 'Zenoh'}
    rows = [['', *(text for it in results for text in (titles[it['middleware']], 'bare'))],
            ['---'] * (1 + 2 * len(results))]

    def row(name, pairs):
        rows.append([name, *('' if it is None or math.isnan(it) else f'{it:.2f}' for pair in pairs for it in pair)])
    for part in (0.5, 0.99, 1.0):
        name = 'most' if part == 1 else f'p{part * 100:.0f}'
        row(f'round trip of a service, {name}, ms',
            [[quantile(it['round_trip'][kind], part) for kind in ('kerf', 'bare')] for it in results])
    for kind, text in (('answer', 'its answer'), ('written', 'the write of `!`')):
        for part in (0.5, 0.99, 1.0):
            name = 'most' if part == 1 else f'p{part * 100:.0f}'
            row(f'hold, to {text}, {name}, ms',
                [[quantile(it['hold'].get(kind, []), part), quantile(it['hold']['bare'], part)
                  if kind == 'answer' else None] for it in results])
    for elements in results[0]['path']:
        for field, text in (('manifest_s', 'manifest'), ('whole_s', 'whole and checked'),
                            ('checking_s', 'of which the check')):
            row(f'path of {int(elements):,} elements, {text}, s'.replace(',000', ' 000'), [
                [quantile([made[field] for made in it['path'][elements][kind]], 0.5)
                 for kind in ('kerf', 'bare')] for it in results if elements in it['path']])
    rows.append(['lost or failed', *(text for it in results for text in (
        str(len([1 for failed in it['failures'] if 'bare' not in failed['what']])),
        str(len([1 for failed in it['failures'] if 'bare' in failed['what']]))))])
    lines = '\n'.join('| ' + ' | '.join(cells) + ' |' for cells in rows)
    loads = ', '.join(f'{it["middleware"]} {it["begin"]} load {min(it["loads"]):.1f} to {max(it["loads"]):.1f}'
                      for it in results)
    return f'{lines}\n\n{loads}'


if __name__ == '__main__':
    main()
