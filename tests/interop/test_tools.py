"""Wear corrections: the tool table is changed and the loaded program planned again."""

import pytest

from programs import load_demo
from ros2 import LATCHED, service

SetTool = service('cnc_msgs/srv/SetTool')


@pytest.fixture
def set_tool(node):
    client = node.client(SetTool.name, 'set_tool')
    return lambda **request: client.call(**request)


def table(node):
    answer = node.client('cnc_msgs/srv/GetTools', 'get_tools').call()
    assert answer.success
    return answer.table


def facts(table):
    """What is in a table; its stamp is that of the message."""
    return table.revision, table.tools, table.offsets


def test_a_wear_correction_makes_a_new_path(node, set_tool):
    loaded, before = load_demo(node)
    paths = node.subscription('cnc_msgs/msg/CompensatedPath', 'compensated_path', LATCHED)
    # Half a tenth off the diameter: the tool goes nearer to the contour.
    answer = set_tool(offset_number=1, mask=SetTool.Request.WEAR_DIAMETER, wear_diameter=-0.00005)
    assert answer.success, answer.message
    after = paths.wait(lambda path: path.revision > before.revision)
    assert after.program_id == loaded.program_id
    assert after.tool_table_revision == answer.revision
    assert after.sha256 != before.sha256
    assert after.feed_length != before.feed_length


def test_the_report_is_of_the_new_plan(node, set_tool):
    load_demo(node)
    reports = node.subscription('cnc_msgs/msg/CompensationReport', 'compensation_report', LATCHED)
    answer = set_tool(offset_number=1, mask=SetTool.Request.WEAR_DIAMETER, wear_diameter=0.0)
    # The report comes first without its certificates.
    report = reports.wait(lambda report: report.tool_table_revision == answer.revision
                          and report.certificate_count > 0)
    assert report.accepted and report.error_count == 0
    [certificate] = report.certificates
    assert certificate.radius == pytest.approx(0.005)


def test_the_table_that_is_latched_is_the_one_of_the_service(node, set_tool):
    tables = node.subscription('cnc_msgs/msg/ToolTable', 'tool_table', LATCHED)
    answer = set_tool(offset_number=1, mask=SetTool.Request.WEAR_DIAMETER, wear_diameter=-0.0001)
    latched = tables.wait(lambda it: it.revision == answer.revision)
    assert facts(latched) == facts(table(node))
    # The wear of a radius is half of that of a diameter.
    assert latched.offsets[0].wear == pytest.approx(-0.00005)


def test_a_tool_that_does_not_fit_the_loaded_program_changes_nothing(node, set_tool):
    load_demo(node)
    before = facts(table(node))
    answer = set_tool(offset_number=1, mask=SetTool.Request.DIAMETER, diameter=0.060)
    assert not answer.success
    assert answer.error_code == SetTool.Response.PLAN_REFUSED
    assert 'mm' in answer.message
    assert facts(table(node)) == before


def test_a_value_that_no_tool_can_have_is_refused(node, set_tool):
    before = facts(table(node))
    for which, diameter in [
        ({'offset_number': 1}, float('nan')), ({'offset_number': 1}, float('inf')),
        # The radius of an offset may be negative on this control, a tool may not.
        ({'tool_number': 1}, -0.001), ({}, 0.001), ({'tool_number': 1, 'offset_number': 1}, 0.001),
    ]:
        answer = set_tool(mask=SetTool.Request.DIAMETER, diameter=diameter, **which)
        assert not answer.success
        assert answer.error_code == SetTool.Response.INVALID_REQUEST
        assert answer.message
    assert facts(table(node)) == before
