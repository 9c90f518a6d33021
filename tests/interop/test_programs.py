"""Loading and planning, as a cell sees it."""

import hashlib
import zlib
from itertools import pairwise

from machine import CONTOUR
from programs import load, load_demo, settle
from ros2 import LATCHED, Qos, service
from ros2.interfaces import cdr_body

LoadProgram = service('cnc_msgs/srv/LoadProgram')


def test_a_program_is_loaded_from_a_file_and_planned(machine, node):
    answer, path = load_demo(node)
    assert answer.line_count == 14
    assert answer.findings == []
    assert len(answer.program_id) == 16
    # Metres: the contour reaches from X15 to X110.
    assert abs(answer.bounds_max.x - 0.110) < 1e-9
    assert path.control == 'sinumerik_840c'
    assert path.header.frame_id == f'{machine.namespace[1:]}/work'
    assert path.element_count > 0 and path.chunk_count > 0


def test_a_program_is_loaded_from_text(node):
    answer, path = load(node, text='G21 G90\nG0 X5\nG1 X40 F600\nM30\n', name='two.ngc')
    assert answer.line_count == 4
    assert path.program_id == answer.program_id


def test_a_program_with_an_error_is_refused_with_its_place(node):
    answer = node.client(LoadProgram.name, 'load_program').call(
        text='G21\nG99.7 X1\nM30\n', name='bad.ngc')
    assert not answer.success
    assert answer.error_code == LoadProgram.Response.PROGRAM_REFUSED
    assert answer.program_id == ''
    [finding] = answer.findings
    assert (finding.line, finding.column, finding.code) == (2, 1, 'unknown_word')


def test_a_program_with_a_tool_that_is_not_expected_is_refused(node):
    program = 'G21 G90\nT2 M6\nG1 X5 F600\nT7 M6\nG1 X9\nM30\n'
    client = node.client(LoadProgram.name, 'load_program')
    answer = client.call(text=program, name='tools.ngc', expected_tools=[1, 2])
    assert answer.error_code == LoadProgram.Response.PROGRAM_REFUSED
    [finding] = answer.findings
    assert (finding.line, finding.code) == (4, 'unknown_tool')
    assert 'T7' in finding.message and 'T1, T2' in finding.message
    assert client.call(text=program, name='tools.ngc', expected_tools=[7, 2]).success
    assert client.call(text=program, name='tools.ngc').success


def test_a_file_that_is_not_there_is_refused(node):
    answer = node.client(LoadProgram.name, 'load_program').call(path='/no/such.ngc')
    assert not answer.success
    assert answer.error_code == LoadProgram.Response.FILE_UNREADABLE
    assert '/no/such.ngc' in answer.message


def test_a_long_path_is_fetched_whole_by_chunks(node):
    moves = ''.join(f'X{number % 300}.{number % 10} Y{number % 7}\n' for number in range(4000))
    answer, path = load(node, text=f'G21 G90 G1 F600\n{moves}M30\n', name='long.ngc')
    assert path.chunk_count > 3

    chunks = fetch(node, 'cnc_msgs/srv/GetPathChunks', 'compensated_path/get_chunks',
                   program_id=answer.program_id, revision=path.revision)
    assert len(chunks) == path.chunk_count
    assert sum(len(chunk.elements) for chunk in chunks) == path.element_count
    bodies = [cdr_body(chunk, 'elements', 'events') for chunk in chunks]
    assert [zlib.crc32(body) for body in bodies] == [chunk.crc32 for chunk in chunks]
    assert hashlib.sha256(b''.join(bodies)).hexdigest() == path.sha256
    # Each element begins where the one before it ended.
    elements = [element for chunk in chunks for element in chunk.elements]
    assert all(before.end == after.start for before, after in pairwise(elements))


def test_whoever_listens_to_the_chunks_has_the_path_without_asking(node):
    listener = node.subscription('cnc_msgs/msg/PathChunk', 'compensated_path/chunks',
                                 Qos(depth=1000))
    settle(node, 'compensation_planner')
    answer, path = load(node, text='G21 G90 G1 F600\nX10\nY10\nX0\nY0\nM30\n', name='square.ngc')
    [chunk] = listener.collect(1)
    assert (chunk.program_id, chunk.revision) == (answer.program_id, path.revision)
    assert chunk.index == 0 and chunk.chunk_count == 1


def test_text_and_contour_are_had_by_chunks_too(node):
    answer, _ = load_demo(node)
    program = node.subscription('cnc_msgs/msg/Program', 'program', LATCHED).wait(
        lambda program: program.program_id == answer.program_id)
    text = b''.join(bytes(chunk.data) for chunk in fetch(
        node, 'cnc_msgs/srv/GetProgramChunks', 'program/get_chunks'))
    assert text == CONTOUR.read_bytes()
    assert hashlib.sha256(text).hexdigest() == program.sha256

    contour = node.subscription(
        'cnc_msgs/msg/ProgrammedContour', 'programmed_contour', LATCHED).wait(
        lambda contour: contour.program_id == answer.program_id)
    chunks = fetch(node, 'cnc_msgs/srv/GetContourChunks', 'programmed_contour/get_chunks')
    bodies = b''.join(cdr_body(chunk, 'events') for chunk in chunks)
    assert hashlib.sha256(bodies).hexdigest() == contour.sha256


def test_a_long_program_is_uploaded_in_pieces(node):
    text = 'G21 G90 G1 F600\n' + 'X100\nX0\n' * 10_000 + 'M30\n'
    pieces = [text[start:start + 40_000] for start in range(0, len(text), 40_000)]
    put = node.client('cnc_msgs/srv/PutProgramChunk', 'put_program_chunk')
    for index, piece in enumerate(pieces):
        answer = put.call(upload_id='of-the-cell', index=index, chunk_count=len(pieces),
                          data=list(piece.encode()), crc32=zlib.crc32(piece.encode()))
        assert answer.success, answer.message
    answer, path = load(node, upload_id='of-the-cell', name='uploaded.ngc')
    assert answer.line_count == 20_002
    assert path.element_count == 20_000


def test_who_comes_late_gets_all_that_is_latched(machine, node):
    answer, _ = load_demo(node)
    with machine.node('latecomer') as late:
        for type_name, topic, belongs in [
            ('cnc_msgs/msg/Program', 'program', True),
            ('cnc_msgs/msg/ProgrammedContour', 'programmed_contour', True),
            ('cnc_msgs/msg/CompensatedPath', 'compensated_path', True),
            ('cnc_msgs/msg/CompensationReport', 'compensation_report', True),
            ('cnc_msgs/msg/ToolTable', 'tool_table', False),
            ('cnc_msgs/msg/MachineState', 'machine_state', False),
            ('cnc_msgs/msg/ControllerSettings', 'controller_settings', False),
            ('cnc_msgs/msg/Recording', 'recording', False),
            ('cnc_msgs/msg/NodeParameters', 'node_parameters', False),
            ('nav_msgs/msg/Path', 'compensated_path/preview', False),
            ('visualization_msgs/msg/MarkerArray', 'markers', False),
        ]:
            topic = late.subscription(type_name, topic, LATCHED)
            topic.wait(lambda it: not belongs or it.program_id == answer.program_id)


def fetch(node, type_name, name, **request):
    """Asks until all chunks are there, each time from the first that is missing."""
    client = node.client(type_name, name)
    chunks = []
    while True:
        answer = client.call(first=len(chunks), **request)
        assert answer.success, answer.message
        chunks += answer.chunks
        assert [chunk.index for chunk in chunks] == list(range(len(chunks)))
        if len(chunks) == chunks[0].chunk_count:
            return chunks
