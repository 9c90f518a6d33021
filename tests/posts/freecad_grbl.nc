(Exported by FreeCAD)
(Post Processor: grbl_post.py)
(Output Time:2023-05-01)
(Begin preamble)
G17 G90
G21
(Begin operation: Fixture)
(Path: Fixture)
G54
(Finish operation: Fixture)
(Begin operation: TC: Default Tool)
(Path: TC: Default Tool)
(Default Tool)
(Begin toolchange)
( M6 T1 )
M3 S0
(Finish operation: TC: Default Tool)
(Begin operation: Pocket)
(Path: Pocket)
(Pocket)
G0 Z5.000
G0 X1.000 Y1.000
G1 X1.000 Y1.000 Z-1.000 F100.0
G3 X-1.000 Y1.000 Z-1.000 I-1.000 J0.000 K0.000
G0 Z5.000
(Finish operation: Pocket)
(Begin postamble)
M5
G17 G90
M2
