( File created: Monday, May 01 2023 - 10:00 AM)
( Profile 1)
( Material Size)
( X= 100.000, Y= 100.000, Z= 12.000)
( Z Origin for Material  = Material Surface)
( XY Origin for Material = Bottom Left Corner)
( XY Origin Position = X:0.000, Y:0.000)
( Home Position)
( X = 0.000 Y = 0.000 Z = 20.320)
( Safe Z = 5.080)
()
( Toolpaths used in this file:)
( Profile 1)
()
( Tools used in this file: )
( 1 = End Mill {6 mm})
()
()
(|---------------------------------------)
(| Toolpath:- 'Profile 1'    )
(|---------------------------------------)
N100G00G21G17G90G40G49G80
N110G71G91.1
N120T1M06
N130 (End Mill {6 mm})
N140G00G43Z20.320H1
N150S12000M03
N160(Toolpath:- Profile 1)
N170()
N180G94
N190X0.000Y0.000F1000.0
N200G00X10.000Y10.000Z5.080
N210G1Z-3.000F500.0
N220G1X50.000F1000.0
N230G3X60.000Y20.000I0.000J10.000
N240G00Z5.080
N250G00Z20.320
N260G00X0.000Y0.000
N270M09
N280M30
%
