%
(1001)
(Using high feed G1 F1000. instead of G0.)
(T1 D=6. CR=0. - ZMIN=-1. - flat end mill)
G90 G94
G17
G21
(When using Fusion for Personal Use, the feedrate of rapid)
(moves is reduced to match the feedrate of cutting moves,)
(which can increase machining time. Unrestricted rapid moves)
(are available with a Fusion Subscription.)
G28 G91 Z0
G90

(2D Pocket1)
T1
S5000 M3
G54
G0 X10. Y10.
Z15.
G0 Z5.
G1 Z1. F333.3
X9.9 Z0.9 F1000.
G2 X10. Y12. I0.1 J1.
G1 X12. Y12.
G0 Z15.
G28 G91 Z0
G90
G28 G91 X0 Y0
G90
M5
M30
%
