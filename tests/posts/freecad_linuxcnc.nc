(Exported by FreeCAD)
(Post Processor: linuxcnc_post)
(Output Time:2023-05-01 10:00:00.123456)
(begin preamble)
G17 G54 G40 G49 G80 G90
G21
(begin operation: Fixture)
(machine units: mm/min)
G54
(finish operation: Fixture)
(begin operation: TC: 6mm Endmill)
(machine units: mm/min)
(TC: 6mm Endmill)
(begin toolchange)
( 6mm Endmill )
M5
M6 T1
G43 H1
M3 S5000.00
(finish operation: TC: 6mm Endmill)
(begin operation: Profile)
(machine units: mm/min)
(Profile)
(Compensated Tool Path. Diameter: 6.0)
G0 Z17.000000
G0 X-2.121000 Y-2.121000
G0 Z15.000000
G1 X-2.121000 Y-2.121000 Z0.000000 F120.000
G2 X-3.000000 Y0.000000 Z0.000000 I2.121000 J2.121000 K0.000000 F600.000
G1 X-3.000000 Y30.000000 Z0.000000
G0 Z17.000000
(finish operation: Profile)
(begin operation: Drilling)
(Drilling)
(Begin Drilling)
G0 Z17.000
G90
G98
G83 X10.000 Y10.000 Z-10.000 F120.000 R15.000 Q2.000
G80
G0 Z17.0
(finish operation: Drilling)
(begin postamble)
M05
G17 G54 G90 G80 G40
M2
