( pcb2gcode 2.5.0 )
( This file uses 2 drill bit sizes. )
( Bit sizes: [0.8mm] [1mm] )
G94     ( Millimeters per minute feed rate.             )
G21     ( Units == Millimeters. )
G91.1   ( Incremental arc distance mode.         )
G90     ( Absolute coordinates.                  )
G00 S20000.00000     ( RPM spindle speed.                     )
G00 Z10.00000 ( Retract )
T1
M5      ( Spindle stop.                          )
G04 P0.00000
(MSG, Change tool bit to drill size 0.8mm)
M6      ( Tool change.                           )
M0      ( Temporary machine stop.                )
M3      ( Spindle on clockwise.                  )
G0 Z2.00000
G04 P0.00000
G81 R2.00000 Z-2.00000 F100.00000 X1.00000 Y1.00000
X2.00000 Y1.00000
G00 Z10
M5
M9
M2
