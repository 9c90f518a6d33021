(Project test)
(Created by Estlcam version 11 build 11.245)
(Machining time about 00:01:23 hours)

(Required tools:)
(No. 1: End mill 6mm)
G21
G90
G94
T1 M06 (End mill 6mm)
M03 S24000
G00 Z5.0000
G00 X0.0000 Y0.0000

(No. 1 Part 1)
G00 X10.0000 Y10.0000
G00 Z0.5000
G01 Z-3.0000 F300 S24000
G01 X20.0000 F1200
G02 X20.0000 Y20.0000 I0.0000 J5.0000
G00 Z5.0000
G00 X0.0000 Y0.0000
M05
M30
