"""Packets of RTPS with numbers beyond all measure, as a hostile or broken peer
sends them on the loopback interface: see docs/upstream."""

import socket
import struct
import time

# Participants that are looked for on the loopback interface.
PARTICIPANTS = 12
# The endpoints that announce writers; every participant has both, matched with those of all others.
READER, WRITER = bytes((0, 0, 3, 0xc7)), bytes((0, 0, 3, 0xc2))


def sequence_number(number):
    return struct.pack('<II', number >> 32, number & 0xffffffff)


def packet(sender, kind, *body):
    body = b''.join(body)
    return b'RTPS\x02\x04\x01\x12' + sender + struct.pack('<BBH', kind, 1, len(body)) + body


def nack_frag(sender, fragment):
    numbers = struct.pack('<4I', fragment, 1, 0x80000000, 1)
    return packet(sender, 0x12, READER, WRITER, sequence_number(1), numbers)


def data_frag(sender):
    sizes = struct.pack('<IHHI', 1, 1, 1024, 0xfffffff0)
    head = bytes((0, 0, 28, 0)) + READER + WRITER + sequence_number(1000)
    return packet(sender, 0x16, head, sizes, bytes(1024))


def heartbeat(sender):
    numbers = sequence_number(1) + sequence_number(1 << 62) + struct.pack('<I', 1_000_000)
    return packet(sender, 7, READER, WRITER, numbers)


def gap(sender):
    numbers = sequence_number(100_000) + sequence_number(1 << 32) + bytes(4)
    return packet(sender, 8, READER, WRITER, numbers)


PACKETS = {
    'NACK_FRAG 0': lambda sender: nack_frag(sender, 0),
    'NACK_FRAG 0xfffffff0': lambda sender: nack_frag(sender, 0xfffffff0),
    'DATA_FRAG of 4 GB': data_frag,
    'HEARTBEAT 1 to 2^62': heartbeat,
    'GAP to 2^32': gap,
}


def ports(domain):
    """Where the participants of a domain listen, on this computer."""
    return [7400 + 250 * domain + kind + 2 * number
            for number in range(PARTICIPANTS) for kind in (10, 11)]


def participants(domain, count):
    """The participants that announce themselves to unused ports."""
    listening = []
    for port in ports(domain):
        one = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        one.setblocking(False)
        try:
            one.bind(('127.0.0.1', port))
            listening.append(one)
        except OSError:
            one.close()
    found, end = set(), time.monotonic() + 60
    while len(found) < count:
        assert time.monotonic() < end, f'{len(found)} of {count} participants'
        for one in listening:
            try:
                data = one.recv(65536)
            except BlockingIOError:
                continue
            if data.startswith(b'RTPS') and len(data) > 20:
                found.add(data[8:20])
        time.sleep(0.02)
    for one in listening:
        one.close()
    return found


def send(domain, make):
    """Sends every participant of a domain a packet in the name of each."""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as sender:
        for prefix in participants(domain, 4):
            for port in ports(domain):
                sender.sendto(make(prefix), ('127.0.0.1', port))
