(error forbidden_under_compensation 4:1; error forbidden_under_compensation 5:1)
G0 X0 Y0 F100
G41 P5 G1 X10 Y10
G18
G55
G40 X0 Y0
M30
