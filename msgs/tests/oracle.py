#!/usr/bin/env python3
"""Checks type hashes and CDR bytes against a second implementation, `rosbags`.

    pip install rosbags==0.11.9
    python3 msgs/tests/oracle.py            compare with the fixtures; exit 1 if they differ
    python3 msgs/tests/oracle.py --write    write them anew, after a change of a definition

Definitions of other packages come from the Jazzy store of rosbags, so that the
files in share/ are checked against them; those that the store lacks (services)
are read from share/ by the parser of rosbags.

fixtures/messages.json   values, one row a message, for anyone to edit; --write adds
                         rows for our messages that have none, and makes those
                         anew that do not fit their definition any more
fixtures/hashes.txt      golden type hashes, written here
fixtures/cdr.txt         golden bytes of the rows, little-endian without encapsulation, written here
fixtures/big_endian.txt  one row as a big-endian peer sends it, with encapsulation, written here
"""

import json
import re
import struct
import sys
from pathlib import Path

import numpy
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_types_from_msg, get_typestore
from rosbags.typesys.base import normalize_fieldname

HERE = Path(__file__).parent
FIXTURES = HERE / 'fixtures'
PACKAGE = HERE.parent

NAME, BASE, ARRAY, SEQUENCE = Nodetype.NAME, Nodetype.BASE, Nodetype.ARRAY, Nodetype.SEQUENCE
EMPTY = [('structure_needs_at_least_one_member', (BASE, ('uint8', 0)))]


def files():
    """Yields package, folder, name and text of every interface file."""
    roots = [('cnc_msgs', PACKAGE)]
    roots += [(path.name, path) for path in sorted((PACKAGE / 'share').iterdir())]
    for package, root in roots:
        for folder in ('msg', 'srv', 'action'):
            for path in sorted((root / folder).glob(f'*.{folder}')):
                yield package, folder, path.stem, path.read_text()


def parse(text, full_name):
    """Constants and fields of a text, with `full_name` as its context."""
    package, _, name = full_name.split('/')
    stand_in = f'{package}/msg/{name.replace("_", "")}'
    constants, fields = get_types_from_msg(text, stand_in)[stand_in]
    return constants, fields or EMPTY


def of(name):
    return (NAME, name)


def add_service(types, name, request, response):
    types[f'{name}_Request'] = request
    types[f'{name}_Response'] = response
    types[f'{name}_Event'] = ([], [
        ('info', of('service_msgs/msg/ServiceEventInfo')),
        ('request', (SEQUENCE, (of(f'{name}_Request'), 1))),
        ('response', (SEQUENCE, (of(f'{name}_Response'), 1))),
    ])
    parts = ('request', 'response', 'event')
    types[name] = ([], [(f'{part}_message', of(f'{name}_{part.title()}')) for part in parts])


def add_action(types, name, goal, result, feedback):
    goal_id = ('goal_id', of('unique_identifier_msgs/msg/UUID'))
    types[f'{name}_Goal'], types[f'{name}_Result'], types[f'{name}_Feedback'] = goal, result, feedback
    add_service(
        types, f'{name}_SendGoal',
        ([], [goal_id, ('goal', of(f'{name}_Goal'))]),
        ([], [('accepted', (BASE, ('bool', 0))), ('stamp', of('builtin_interfaces/msg/Time'))]),
    )
    add_service(
        types, f'{name}_GetResult',
        ([], [goal_id]),
        ([], [('status', (BASE, ('int8', 0))), ('result', of(f'{name}_Result'))]),
    )
    types[f'{name}_FeedbackMessage'] = ([], [goal_id, ('feedback', of(f'{name}_Feedback'))])
    types[name] = ([], [
        ('goal', of(f'{name}_Goal')),
        ('result', of(f'{name}_Result')),
        ('feedback', of(f'{name}_Feedback')),
        ('send_goal_service', of(f'{name}_SendGoal')),
        ('get_result_service', of(f'{name}_GetResult')),
        ('feedback_message', of(f'{name}_FeedbackMessage')),
    ])


def build():
    """The Jazzy store with our types in it, and the names of all that the files define."""
    store = get_typestore(Stores.ROS2_JAZZY)
    # rosidl makes uint8 of char, and hashes that; rosbags hashes char.
    constants, fields = store.fielddefs['service_msgs/msg/ServiceEventInfo']
    fields = [(name, (ARRAY, ((BASE, ('uint8', 0)), 16)) if name == 'client_gid' else desc)
              for name, desc in fields]
    store.fielddefs['service_msgs/msg/ServiceEventInfo'] = (constants, fields)

    types, names, problems = {}, [], []
    for package, folder, name, text in files():
        full_name = f'{package}/{folder}/{name}'
        sections = [parse(part, full_name) for part in re.split(r'^---[ \t]*$', text, flags=re.M)]
        new = {}
        if folder == 'msg':
            new[full_name] = sections[0]
        elif folder == 'srv':
            add_service(new, full_name, *sections)
        else:
            add_action(new, full_name, *sections)
        names += new
        if full_name in store.fielddefs:
            if full_name != 'service_msgs/msg/ServiceEventInfo':
                problems += compare(full_name, new[full_name], store.fielddefs[full_name])
        else:
            types.update(new)
    store.register(types)
    return store, sorted(names), problems


def compare(name, ours, theirs):
    def facts(definition):
        constants, fields = definition
        return sorted(tuple(item) for item in constants), [tuple(item) for item in fields]
    if facts(ours) == facts(theirs):
        return []
    return [f'{name} in share/ is not that of Jazzy:\n  {facts(ours)}\n  {facts(theirs)}']


def make(store, type_name, value):
    """A rosbags message from its JSON value."""
    fields = store.fielddefs[type_name][1]
    if list(value) != [name for name, _ in fields]:
        raise ValueError(f'the row has {list(value)}, the type {[name for name, _ in fields]}')
    return store.types[type_name](**{
        normalize_fieldname(name): make_field(store, desc, value[name]) for name, desc in fields
    })


def make_field(store, desc, value):
    kind, inner = desc
    if kind == NAME:
        return make(store, inner, value)
    if kind == BASE:
        return value
    (kind, inner), _ = inner
    if kind == NAME:
        return [make(store, inner, element) for element in value]
    if inner[0] == 'string':
        return value
    dtype = {'bool': 'bool_', 'byte': 'uint8', 'char': 'uint8'}.get(inner[0], inner[0])
    return numpy.array(value, dtype=getattr(numpy, dtype))


class Draft:
    """Values that differ from each other and from the defaults."""

    def __init__(self, store):
        self.store, self.count = store, 0

    def message(self, type_name):
        fields = self.store.fielddefs[type_name][1]
        if fields == EMPTY:
            return {EMPTY[0][0]: 0}
        return {name: self.field(name, desc) for name, desc in fields}

    def field(self, name, desc):
        kind, inner = desc
        if kind == NAME:
            return self.message(inner)
        if kind == BASE:
            return self.single(name, inner[0])
        element, size = inner
        # an odd number of elements, so that what follows must be aligned
        return [self.field(name, element) for _ in range({ARRAY: size, SEQUENCE: min(size or 3, 3)}[kind])]

    def single(self, name, base):
        self.count += 1
        if base == 'string':
            return f'{name} {self.count}' + '.' * (self.count % 4)
        if base == 'bool':
            return True
        if base.startswith('float'):
            return self.count * (-1.0) ** self.count + 0.125
        if base in ('uint8', 'byte', 'char'):
            return self.count % 250 + 1
        if base == 'int8':
            return -(self.count % 120) - 1
        scale = {'16': 257, '32': 70_001, '64': 5_000_000_001}[base[-2:]]
        return self.count % 120 * scale * (1 if base[0] == 'u' else -1) + 1


def encode(store, row, little_endian=True):
    """CDR of a row, with its four bytes of encapsulation."""
    message = make(store, row['type'], row['value'])
    return bytes(store.serialize_cdr(message, row['type'], little_endian=little_endian))


def fits(store, row):
    try:
        encode(store, row)
    except (ValueError, KeyError, TypeError, AttributeError, struct.error):
        return False
    return True


def is_own_message(name, names):
    parts = ('_Event', '_SendGoal', '_GetResult')
    whole = f'{name}_Request' in names or f'{name}_Goal' in names
    return name.startswith('cnc_msgs/') and not whole and not name.endswith(parts)


def redraft(store, names, rows):
    """Rows in the order of their types, each fitting its definition."""
    rows = {row['type']: row for row in rows if row['type'] in names}
    for name in names:
        if name in rows and fits(store, rows[name]):
            continue
        if name in rows or is_own_message(name, names):
            rows[name] = {'type': name, 'value': Draft(store).message(name)}
    return [rows[name] for name in sorted(rows)]


def main():
    store, names, problems = build()
    path = FIXTURES / 'messages.json'
    rows = json.loads(path.read_text())
    if '--write' in sys.argv:
        rows = redraft(store, names, rows)
        path.write_text('[\n' + ',\n'.join(json.dumps(row) for row in rows) + '\n]\n')

    hashes = ''.join(f'{name} {store.hash_rihs01(name)}\n' for name in names)
    cdr, big_endian = '', ''
    for row in rows:
        if fits(store, row):
            cdr += f'{row["type"]} {encode(store, row)[4:].hex()}\n'
            if row['type'] == 'cnc_msgs/msg/MachineState':
                big_endian = f'{row["type"]} {encode(store, row, little_endian=False).hex()}\n'
        else:
            problems.append(f'{path}: the row of {row["type"]} does not fit its definition')

    golden = {'hashes.txt': hashes, 'cdr.txt': cdr, 'big_endian.txt': big_endian}
    for file, text in golden.items():
        path = FIXTURES / file
        if '--write' in sys.argv:
            path.write_text(text)
        elif not path.exists() or path.read_text() != text:
            known = path.read_text().splitlines() if path.exists() else []
            new = [line for line in text.splitlines() if line not in known]
            problems += [f'{path}: rosbags says {line[:160]}' for line in new]
            problems += [] if new else [f'{path} has lines that rosbags does not know']
    for problem in problems:
        print(problem, file=sys.stderr)
    return 1 if problems else 0


if __name__ == '__main__':
    sys.exit(main())
