"""Tables in the layouts of instruments: text, columns, and the values expected in SI units."""

# ruff: noqa: E501

from mdr_dask.headings import Column

DMA = (
    Column("frequency", "rad/s", above=0),
    Column("storage modulus", "Pa", above=0),
    Column("loss modulus", "Pa", needed=False, above=0),
    Column("temperature", "K", needed=False, above=0),
    Column("tan delta", "1", needed=False, above=0),
)
OIL = (Column("temperature", "K", above=0), Column("dynamic viscosity", "Pa s", above=0))
FRICTION = (
    Column("velocity", "m/s", above=0),
    Column("friction coefficient", "1"),
    Column("normal force", "N", needed=False),
)
SPECTRUM = (Column("wavenumber", "rad/m", above=0), Column("C2D", "m^4", above=0))
SHIFTS = (Column("temperature", "K", above=0), Column("log10 a_T", "1", ("log aT", "log(aT)", "log10 aT")))
STEPS = (Column("time", "s"), Column("velocity", "m/s"), Column("friction coefficient", "1"))

TRIOS = """\
Filename\tC:\\data\\rubber.tri
Instrument name\tDMA850
Sample name\tEPDM 70
Geometry\t8.0

[step]
Frequency sweep at -20 °C
Ang. frequency\tStorage modulus\tLoss modulus\tTan(delta)\tTemperature\tTorque
rad/s\tMPa\tMPa\t\t°C\tµN.m
1,0\t10,0\t2,0\t0,2\t-20,0\t5
10,0\t20,0\t4,0\t0,2\t-20,0\t5

[step]
Frequency sweep at 20 °C
Ang. frequency\tStorage modulus\tLoss modulus\tTan(delta)\tTemperature\tTorque
rad/s\tMPa\tMPa\t\t°C\tµN.m
1,0\t2,0\t0,4\t0,2\t20,0\t5
"""
STEPS_STATED = """\
Data set 1, Temperature = 20 °C
Angular frequency;Storage modulus;Loss modulus
rad/s;Pa;Pa
1;1e6;1e5
10;2e6;2e5
Data set 2, Temperature = 40 °C
Angular frequency;Storage modulus;Loss modulus
rad/s;Pa;Pa
1;5e5;5e4
"""

RHEOMETER = """\
Project:\tTread L37
Operator:\tK. Müller

Result:\tFrequency sweep 1
Interval and data points:\t1\t2
Interval data:\tPoint No.\tAngular frequency\tStorage modulus\tLoss modulus\tLoss factor\tTemperature\tStatus

\t\t[rad/s]\t[Pa]\t[Pa]\t[1]\t[°C]\t
\t1\t0,1\t2,906e+07\t1,5785e+07\t0,5432\t-40,09\tTruStrain™
\t2\t1\t5,9123e+07\t3,174e+07\t0,5368\t-40,11\t

Result:\tFrequency sweep 2
Interval and data points:\t1\t2
Interval data:\tPoint No.\tAngular frequency\tStorage modulus\tLoss modulus\tLoss factor\tTemperature\tStatus

\t\t[rad/s]\t[Pa]\t[Pa]\t[1]\t[°C]\t
\t1\t0,1\t3,0708e+06\t1,3821e+06\t0,4501\t-25,18\tTruStrain™
"""

# fmt: off
#: Name: text, columns, and the first value of some of them in SI.
READ = {
    "rheometer with settings between blocks": (RHEOMETER, DMA, {"storage modulus": 2.906e7, "temperature": 233.06}),
    "German names": ("Kreisfrequenz [rad/s];Speichermodul [MPa];Temperatur [°C]\n0,1;2,5;20\n1;3,5;20\n",
        DMA, {"frequency": 0.1, "storage modulus": 2.5e6, "temperature": 293.15}),
    "names with symbols, abbreviations": ("Ang. freq. ω [rad/s],Stor. mod. G' [MPa],Temp. [K]\n2,3,300\n3,4,300\n",
        DMA, {"frequency": 2.0, "storage modulus": 3e6, "temperature": 300.0}),
    "units behind a slash": ("f/Hz;E' / MPa;T/°C\n1;2;20\n2;3;20\n",
        DMA, {"frequency": 6.2832, "storage modulus": 2e6, "temperature": 293.15}),
    "units of one sign": ("f,E',T\nHz,㎪,℃\n1,2,20\n2,3,20\n", DMA, {"storage modulus": 2000.0, "temperature": 293.15}),
    "notes below": ("f [Hz];E' [MPa];T [°C]\n1;2;20\n2;3;20\n\n* limit\nMean;2,5;20\nend of measurement\n",
        DMA, {"storage modulus": 2e6}),
    "no separator, decimal commas": ("velocity [m/s]\n0,5\n0,25\n", (Column("velocity", "m/s"),), {"velocity": 0.5}),
    "few decimal commas between blanks": ("omega [rad/s] E' [kPa] T [°C]\n10,25 1100,5 20,5\n20,25 2200,5 30,5\n",
        DMA, {"frequency": 10.25, "storage modulus": 1.1005e6, "temperature": 293.65}),
    "trios": (TRIOS, DMA, {"frequency": 1.0, "storage modulus": 1e7, "temperature": 253.15}),
    "steps with a stated temperature": (STEPS_STATED, DMA, {"storage modulus": 1e6, "temperature": 293.15}),
    "pandas": ("run,freq_hz,temperature_C,G_storage_pa,G_loss_pa,force_dyn_N\ntf_1,1,20,1e6,1e5,3\ntf_1,2,20,2e6,2e5,3\n",
        DMA, {"frequency": 6.2832, "temperature": 293.15, "storage modulus": 1e6}),
    "both frequencies": ("Frequency (Hz),Angular Frequency (rad/s),Storage Modulus (MPa),Loss Modulus (MPa)\n1,6.283,5,1\n10,62.83,6,1\n",
        DMA, {"frequency": 6.2832, "storage modulus": 5e6}),
    "osc": ("T=40;Mw=223;chem=PI;\nw\tG'\tG''\nrad/s\tPa\tPa\n0.1\t1000\t2000\n1\t3000\t4000\n",
        DMA, {"frequency": 0.1, "storage modulus": 1000.0}),
    "curly": ("Temperature {K},Dynamic viscosity {Pa s}\n283.15,0.1\n313.15,0.03\n", OIL, {"temperature": 283.15}),
    "COF": ("Sliding speed [mm/s],COF [-],Load [N]\n1,0.5,10\n10,0.6,10\n",
        FRICTION, {"velocity": 0.001, "friction coefficient": 0.5}),
    "rig": ("Tribometer 3\nOperator;N. N.\nDate;2024-05-01\n\nTime;Speed;Friction coefficient;Fn\ns;m/s;-;N\n0;0.1;0.5;10\n1;0.2;0.6;10\n",
        FRICTION, {"velocity": 0.1, "normal force": 10.0}),
    "load point": ("Time (s)\tLoad point velocity (um/s)\tFriction\tNormal stress (MPa)\n0\t3\t0.6\t5\n1\t9\t0.61\t5\n",
        STEPS, {"velocity": 3e-6, "friction coefficient": 0.6}),
    "blanks": ("Time(s) Velocity(m/s) Friction\n0 1e-6 0.6\n1 2e-6 0.6\n", STEPS, {"velocity": 1e-6}),
    "psd": ("Wavevector (m^-1),PSD (m^4)\n1e3,1e-16\n1e4,1e-20\n", SPECTRUM, {"wavenumber": 1000.0, "C2D": 1e-16}),
    "C(q)": ("q [1/m],C(q) [m^4]\n1e3,1e-16\n1e4,1e-20\n", SPECTRUM, {"C2D": 1e-16}),
    "names in a remark": ("# q [1/m]  PSD [m^4]\n1e3 1e-16\n1e4 1e-20\n", SPECTRUM, {"C2D": 1e-16}),
    "logarithms": ("log10 q [1/m],log C [m^4]\n3,-20\n4,-24\n", SPECTRUM, {"wavenumber": 1000.0, "C2D": 1e-20}),
    "logarithms in brackets": ("log10(q [1/mm]);log10(C2D / m^4)\n3;-20\n4;-24\n",
        SPECTRUM, {"wavenumber": 1e6, "C2D": 1e-20}),
    "logarithms with a row of units": ("lg(q)\tpsd\n1/m\tm^4\n3\t1e-20\n4\t1e-24\n", SPECTRUM, {"wavenumber": 1000.0}),
    "shift factors": ("T [°C],log aT,bT\n0,1.0,1\n20,0,1\n", SHIFTS, {"temperature": 273.15, "log10 a_T": 1.0}),
    "quotes": ('"Frequency (Hz)","Storage modulus (MPa)"\n"1","5"\n"2","6"\n', DMA, {"storage modulus": 5e6}),
    "trailing separators": ("f [Hz];E' [MPa];\n1;5;\n2;6;\n", DMA, {"storage modulus": 5e6}),
    "primes": ("ω (rad/s),G′ (Pa),G″ (Pa)\n1,5,1\n2,6,1\n", DMA, {"storage modulus": 5.0, "loss modulus": 1.0}),
    "colons": ("Frequency: [Hz]\tG': [Pa]\tG'': [Pa]\n1\t5\t1\n2\t6\t1\n", DMA, {"storage modulus": 5.0}),
    "digitised pairs": ("-20 °C,,20 °C,\nf [Hz],E' [MPa],f [Hz],E' [MPa]\n1,50,1,5\n2,60,2,6\n,,3,7\n",
        DMA, {"storage modulus": 5e7, "temperature": 253.15}),
    "numbers above pairs": ("253.15 K,,293.15 K,\nf [Hz],E' [MPa],f [Hz],E' [MPa]\n1,50,1,5\n2,60,2,6\n",
        DMA, {"temperature": 253.15}),
    "moduli side by side": ("T = -20 °C,,,,T = 20 °C,,\nf [Hz],E' [MPa],tan d,,f [Hz],E' [MPa],tan d\n1,50,1,,1,5,2\n2,60,2,,2,6,2\n,,,,3,7,2\n",
        DMA, {"storage modulus": 5e7, "tan delta": 1.0, "temperature": 253.15}),
    "groups with temperatures of their own": ("f,G',T,f,G',T\nHz,MPa,K,Hz,MPa,K\n1,50,253.15,1,5,293.15\n2,60,253.15,2,6,293.15\n",
        DMA, {"storage modulus": 5e7, "temperature": 253.15}),
    "units of other columns above names with units": ("Unit\ts\tN\tmm/s\nDate\t1.1.\t1.1.\t1.1.\nTime [s]\tFz [N]\tv [mm/s]\tmu\n0\t9\t1\t0.5\n1\t9\t1\t0.5\n",
        FRICTION, {"velocity": 1e-3, "friction coefficient": 0.5}),
    "degF in the text above each step": ("Step 1: T = 68 °F\nf (Hz), G' (psi)\n1, 100\n10, 120\nStep 2: T = 104 °F\nf (Hz), G' (psi)\n1, 80\n",
        DMA, {"temperature": 293.15, "storage modulus": 689475.7}),
    "units behind a comma": ('"Temperature, °C","Viscosity, mPa s"\n10,100\n40,30\n',
        OIL, {"temperature": 283.15, "dynamic viscosity": 0.1}),
    "units behind the word in": ("T in °C;dyn. Viskosität in mPas\n10;100\n40;30\n", OIL, {"dynamic viscosity": 0.1}),
    "symbols in round brackets": ("Velocity (v);Friction coefficient (mu);Force (F)\nm/s;1;N\n0,1;0,5;10\n0,2;0,6;10\n",
        FRICTION, {"velocity": 0.1, "friction coefficient": 0.5, "normal force": 10.0}),
    "more words than numbers": ("sample;operator;rig;remark;v [mm/s];mu\nA;Bob;R1;ok;1;0,5\nB;Bob;R1;;10;0,6\n",
        FRICTION, {"velocity": 0.001}),
    "rule below the names": ("v [mm/s],mu\n-----,-----\n1,0.5\n2,0.6\n", FRICTION, {"velocity": 0.001}),
    "names on two lines": ('"Frequency\n(Hz)","Storage\nModulus (MPa)","Temp.\n(°C)"\n0.1,5.1,20\n1,6.2,20\n',
        DMA, {"storage modulus": 5.1e6, "temperature": 293.15}),
    "names, units and comments": ("Frequency\tStorage modulus\tTemperature\nHz\tMPa\t°C\nrun 1\trun 1\trun 1\n0.1\t5.1\t20\n1\t6.2\t20\n",
        DMA, {"storage modulus": 5.1e6, "temperature": 293.15}),
    "units above names": ("s;mm/s;-\nTime;Speed;COF\n0;1;0.5\n1;2;0.6\n", FRICTION, {"velocity": 0.001}),
    "units of pure numbers behind a slash": ("f/Hz;E'/MPa;tanD/-\n1;3;0,26\n2;4;0,3\n", DMA, {"tan delta": 0.26}),
    "compound units joined to a name": ("speed_mm_s,cof_mean,load_N\n1,0.4,5\n10,0.5,5\n",
        FRICTION, {"velocity": 0.001, "friction coefficient": 0.4, "normal force": 5.0}),
    "rotation speeds in 1/min": ("Drehzahl [1/min];Reibwert\n100;0,1\n1000;0,05\n",
        (Column("rotation speed", "rad/s"), Column("friction coefficient", "1")), {"rotation speed": 10.472}),
    "points between thousands": ("velocity [mm/s];mu\n1.000;0,322\n1.298,6;0,48\n",
        FRICTION, {"velocity": 1.0, "friction coefficient": 0.322}),
    "commas between thousands": ('velocity [mm/s],mu\n"1,000",0.322\n', FRICTION, {"velocity": 1.0}),
    "blanks between thousands": ("velocity [mm/s];mu\n10 000;0,5\n", FRICTION, {"velocity": 10.0}),
    "names and units in comments": ("# rig 3\n# velocity, mu\n# mm/s, -\n1, 0.5\n", FRICTION, {"velocity": 1e-3}),
    "symbols of rotation speed and slide-roll ratio": ("n (rpm);SRR (%);CoF\n60;5;0,1\n",
        (Column("rotation speed", "rad/s"), Column("slide_roll_ratio", "1")),
        {"rotation speed": 6.2832, "slide_roll_ratio": 0.05}),
    "any name of the only column with such a unit": ("T_oil/degC;Viscosity [mPa s]\n10;100\n40;30\n",
        OIL, {"temperature": 283.15}),
    "vertical lines": ("| v [mm/s] | Linear load [N] | mu |\n|---|---|---|\n| 1 | 5 | 0.5 |\n| 2 | 5 | 0.6 |\n",
        FRICTION, {"velocity": 0.001, "normal force": 5.0}),
}
#: Layouts that are refused, each with a part of the sentence that says what to change.
REFUSED = {
    "points and commas": ("velocity [mm/s];mu\n1.5;0,322\n1.7;0,48\n",
        FRICTION, "commas:2: expected decimal commas or decimal points, got both ('1.5', and '0,322' in line 2)"),
    "millions and decimals": ("velocity [mm/s];mu\n1,000,000;0,48\n",
        FRICTION, "expected decimal commas or decimal points, got both ('1,000,000', and '0,48' in line 2)"),
    "thousands or decimals": ("velocity [mm/s];mu\n1.000;1,125\n2.000;1,250\n",
        FRICTION, "expected decimal commas or decimal points, got both"),
    "word between numbers": ("sample;f [Hz];E' [MPa]\nA;1;2\nB;bad;worse\nC;2;3\n",
        DMA, "3: expected a line of numbers, got 'bad'"),
    "names with blanks between blanks": ("Time (s)    Load point velocity (um/s)    Friction\n0   3   0.6\n",
        STEPS, "expected 5 values as in line 1, got 3 (write names without blanks, or put tabs between the columns)"),
    "pairs without temperatures": ("f [Hz],G' [MPa],f [Hz],G' [MPa]\n1,50,1,5\n2,60,2,6\n",
        DMA, "expected 2 temperatures such as '20 degC', one in the heading of each group of columns"),
    "groups at several loads": ("F = 1 N,,F = 2 N,\nv [mm/s],mu,v [mm/s],mu\n1,0.5,1,0.4\n2,0.6,2,0.5\n",
        FRICTION, "expected 2 temperatures such as '20 degC', one in the heading"),
    "groups in several units": ("20 °C,,40 °C,\nf [Hz],G' [MPa],f [Hz],G' [kPa]\n1,50,1,5\n2,60,2,6\n",
        DMA, "disagree: delete one of the two"),
    "number and error in one cell": ("v [mm/s];COF\n1;0,45 ± 0,02\n",
        FRICTION, "write errors in a column of their own"),
    "unit in each cell": ("v [mm/s];mu\n1 mm/s;0,5\n", FRICTION, "write units in the line of names"),
    "one column for each temperature": ("f [Hz];20 °C;40 °C\n1;5;4\n2;6;5\n",
        DMA, "expected a column 'storage modulus', got 20 °C, 40 °C (write the temperatures into a column of their own, and these"),
    "unknown unit in round brackets": ("v [mm/s],mu,Force (Newtons)\n1,0.5,10\n",
        FRICTION, "column normal force: unknown unit 'Newtons' (did you mean 'newton'?)"),
    "numbers below": ("v [mm/s];mu\n1;0,5\n2;0,6\n3;worn out\n",
        FRICTION, "4: column friction coefficient: expected a number"),
}
# fmt: on
