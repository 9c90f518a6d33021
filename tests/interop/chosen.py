"""The machine of the middleware that the tests are run on: Cyclone DDS, or with INTEROP_MIDDLEWARE=zenoh Zenoh."""

import os

if os.environ.get('INTEROP_MIDDLEWARE') == 'zenoh':
    from zenoh_machine import Machine
else:
    from machine import Machine

__all__ = ['Machine']
