"""The programs that the documentation prints, and the part that they cut."""

import os
import re
import signal
import subprocess
import sys

from machine import ROOT, die_with_parent

# A square of 40 mm around which T1 goes on the left, then a line with T2.
PART = '''G21 G90 G94 G17
T1 M6
G0 X0 Y0
G41 G1 X20 Y20 F3000
Y60
X60
Y20
X20
G40 X0 Y0
T2 M6
G1 X10 F3000
M30
'''
TOOLS = '''tools:
  1: {diameter_mm: 6.0}  # the mill
  2: {diameter_mm: 3.0}
'''


def program_of(page, number=0):
    """A Python program on a page, the first one of it."""
    text = (ROOT / page).read_text()
    return re.findall(r'^```python\n(.*?)^```$', text, re.DOTALL | re.MULTILINE)[number]


def start(machine, program, *words):
    """Runs a program in the namespace of the machine."""
    path = machine.file(f'program{abs(hash(program))}.py', program)
    environment = os.environ | {'ROS_DOMAIN_ID': str(machine.domain_id)}
    return subprocess.Popen(
        [sys.executable, '-B', path, *words, '--ros-args', '-r', f'__ns:={machine.namespace}'],
        env=environment, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True,
        preexec_fn=as_in_a_terminal)


def as_in_a_terminal():
    """Ctrl-C counts, also where the tests themselves were started to ignore it."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    die_with_parent()
