#!/usr/bin/env python3
"""Opens pages of `kerf plan --html`, `kerf replay --html` and `kerf bag report` in a real browser.

    tests/oracles/pages.py KERF BAG...
"""

import json
import pathlib
import re
import subprocess
import sys
import tempfile

# Its driver does otherwise today, on purpose.
DONE_OTHERWISE = 'rs274_older_definitions'
ROOT = pathlib.Path(__file__).parents[2]
BROWSER = ['chromium', '--headless', '--no-sandbox', '--disable-gpu', '--window-size=1400,900',
           # Whatever it wants from the network it does not get.
           '--proxy-server=127.0.0.1:9', '--virtual-time-budget=4000']


def opened(page):
    """The document when its script has run."""
    done = subprocess.run([*BROWSER, '--dump-dom', page.as_uri()], capture_output=True, text=True,
                          timeout=120)
    body = re.search(r'<body[^>]*>', done.stdout)
    if body is None or 'data-ready="true"' not in body[0] or 'data-errors=""' not in body[0]:
        sys.exit(f'{page}: the script did not come to its end: {body and body[0]} {done.stderr}')
    return done.stdout


def sheets(page):
    """What a page holds, shown or not."""
    data = re.search(r'id="data">(.*?)</script>', page.read_text(), re.DOTALL)
    found = json.loads(data[1])['sheets']
    if not found:
        sys.exit(f'{page}: there is no sheet on it')
    return found


def expect(text, page, *parts):
    for part in parts:
        if part not in text:
            sys.exit(f'{page}: {part!r} is not shown')


def main():
    kerf, *bags = sys.argv[1:]
    with tempfile.TemporaryDirectory() as folder:
        page = pathlib.Path(folder) / 'page.html'

        def make(status, *words):
            # The page before it would be opened as well.
            page.unlink(missing_ok=True)
            done = subprocess.run([kerf, *words], capture_output=True, text=True)
            if done.returncode != status:
                sys.exit(f'{words}: status {done.returncode}: {done.stdout}{done.stderr}')
            return opened(page)

        demo = ROOT / 'config/demo'
        plan = ['plan', str(demo / 'contour.mpf'), '--control', 'sinumerik_840c', '--quiet',
                '--html', str(page), '--tools']
        shown = make(0, *plan, str(demo / 'tools.yaml'))
        expect(shown, 'an accepted plan', 'accepted', 'compensated (19)', 'N40 G1 X95',
               '>fit</button>', '</i>corner</span>', '</i>lead</span>', '</i>rapid</span>')
        thick = pathlib.Path(folder) / 'thick.yaml'
        thick.write_text('tools:\n  1: {diameter_mm: 60.0}\noffsets:\n  1: {radius_mm: 30.0}\n')
        shown = make(1, *plan, str(thick))
        expect(shown, 'a refused plan', 'refused', 'id="tab-findings"', 'row error')

        is_other = any(pathlib.Path(bag).name == DONE_OTHERWISE for bag in bags)
        shown = make(int(is_other), 'replay', *bags, '--html', str(page))
        expect(shown, 'a replay', 'reproduced', 'compensated now', 'id="tab-dialogue"')
        for bag in bags:
            shown = make(0, 'bag', 'report', bag, str(page))
            expect(shown, f'the report on {bag}', 'recording complete</span>', 'id="tab-dialogue"')
            if not all(sheet['program'] and sheet['layers'] for sheet in sheets(page)):
                sys.exit(f'{bag}: a sheet without program or path')
        print(f'{3 + len(bags)} pages were opened')


if __name__ == '__main__':
    main()
