; LightBurn 1.4.00
; GRBL device profile, absolute coords
; Bounds: X10 Y10 to X20 Y20
G00 G17 G40 G21 G54
G90
M4
; Cut @ 1000 mm/min, 50% power
M8
G0 X10Y10
; Layer C00
G1 X20S500F1000
G1Y20
G1X10
G1Y10
M9
G1 S0
M5
G90
; return to user-defined finish pos
G0 X0 Y0
M2
