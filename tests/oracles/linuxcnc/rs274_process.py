"""LinuxCNC's stand-alone interpreter `rs274` as a process."""

import os
import subprocess

# How what it says of a program without M2, M30 or the last percent sign begins; until there it has
# run it.
NO_END = "File ended with no percent sign"


class Rs274:
    """`root`: where Debian's package of LinuxCNC is unpacked."""

    def __init__(self, root):
        libraries = [root / "usr/lib", *(root / "usr/lib").glob("*-linux-gnu*")]
        self.environment = dict(os.environ, LD_LIBRARY_PATH=":".join(map(str, libraries)))
        # It has a Python in it, whose library was unpacked where none is installed.
        if next((root / "usr/lib").glob("python3.*/os.py"), None):
            self.environment["PYTHONHOME"] = str(root / "usr")
        self.command = root / "usr/bin/rs274"

    def run(self, folder, program, tools, options=(), timeout_s=60):
        """Runs a program. `folder` takes its files; `tools`: number, diameter and length in mm."""
        # Without a machine, LinuxCNC takes the tool table for inches.
        (folder / "tool.tbl").write_text("".join(
            f"T{tool} P{pocket} D{diameter / 25.4:.15f} Z{length / 25.4:.15f}\n"
            for pocket, (tool, diameter, length) in enumerate(tools, 1)))
        (folder / "rs274.var").write_text("")
        # It keeps its tools in a file at home, which two processes would share.
        return subprocess.run(
            [self.command, "-g", "-t", "tool.tbl", "-v", "rs274.var", *options, program],
            cwd=folder, env=self.environment | {"HOME": str(folder)}, capture_output=True,
            text=True, errors="replace", timeout=timeout_s)


def complaints(ran):
    """What it says against a program: the error, and the line that it is in."""
    return [line for line in ran.stderr.splitlines() if line and line != "executing"]
