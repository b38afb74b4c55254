"""Writes the small files beside it: one of each instrument, as its maker prints them, with numbers of our own.

All hold the same 40 samples at 1 kHz of a ring of 90 Hz. After a change, run it again:

    python tests/data/instruments/write.py
"""

import math
from pathlib import Path

HERE = Path(__file__).parent
ROWS = range(40)
T = [k * 1e-3 for k in ROWS]
X = [round(0.5 * math.exp(-t / 0.02) * math.cos(2 * math.pi * 90 * t), 5) for t in T]
Y = [round(1 + 0.3 * math.exp(-t / 0.02) * math.sin(2 * math.pi * 90 * t), 5) for t in T]


def table(*columns, mark=",", form="{}"):
    return "\n".join(
        mark.join(form.format(cell) if i else str(cell) for i, cell in enumerate(row))
        for row in zip(*columns, strict=True)
    )


def de(numbers, digits=6):
    return [f"{number:.{digits}f}".replace(".", ",") for number in numbers]


def exp(numbers):
    return [f"{number:+.6E}" for number in numbers]


BESIDE = [
    ("Record Length", "40", "Points"),
    ("Sample Interval", "1.000000e-03", "s"),
    ("Trigger Point", "0", "Samples"),
    ("Source", "CH1", ""),
    ("Vertical Units", "V", ""),
    ("Horizontal Units", "s", ""),
]
BESIDE += [("", "", "")] * (len(X) - len(BESIDE))

FILES = {
    "tektronix_tds.csv": "\n".join(
        ",".join([*beside, f" {t:.9f}", f" {x:.5f}", ""]) for beside, t, x in zip(BESIDE, T, X, strict=True)
    ),
    "tektronix_mso.csv": "Model,MSO24\nFirmware Version,1.44.3\n\nWaveform Type,ANALOG\nHorizontal Units,s\n"
    "Sample Interval,1.0e-3\nRecord Length,40\nVertical Units,V,V\nLabel,,\nTIME,CH1,CH2\n"
    + table(exp(T), exp(X), exp(Y)),
    "keysight_infiniivision.csv": "x-axis,1,2\nsecond,Volt,Volt\n" + table(exp(T), exp(X), exp(Y)),
    "keysight_infiniium.csv": "Revision:,0\nType:,Raw\nPoints:,40\nXDispRange:,4E-02\nXInc:,1.0E-03\nXOrg:,0\n"
    "XUnits:,Second\nYUnits:,Volt\nData:,\n" + "\n".join(map(str, X)),
    "rigol_ds1000z.csv": "X,CH1,CH2,Start,Increment,\nSequence,Volt,Volt,0.000000e+00,1.000000e-03\n"
    + "\n".join(f"{k},{x:.2e},{y:.2e},," for k, x, y in zip(ROWS, X, Y, strict=True)),
    "rigol_mso5000.csv": "CH1V,CH2V,t0 = 0.000000e+00, tInc = 1.000000e-03,\n" + table(X, Y, [""] * 40),
    "lecroy.csv": "LECROYWR620Zi,1234,Waveform\nSegments,1,SegmentSize,40\nSegment,TrigTime,TimeSinceSegment1\n"
    "#1,21-Mar-2024 09:37:08,0\nTime,Ampl\n" + table(T, X),
    "rohde_schwarz.csv": "in s,C1 in V,C2 in V\n" + table(exp(T), exp(X), exp(Y)),
    "picoscope.csv": "Time,Channel A,Channel B\n(ms),(mV),(V)\n\n"
    + "\n".join(
        f"{1e3 * t:.6f},{'∞' if k == 3 else f'{1e3 * x:.4f}'},{y}" for k, t, x, y in zip(ROWS, T, X, Y, strict=True)
    ),
    "red_pitaya.csv": "Time (s),CH1 (V),CH2 (V)\n" + table([f"{t:.9f}" for t in T], X, Y),
    "digilent.csv": "#Digilent WaveForms Oscilloscope Acquisition\r\n#Device Name: AD2\r\n#Serial Number: SN:0000\r\n"
    "#Date Time: 2024-01-01 13:10:34.255.812.740\r\n#Sample rate: 1000Hz\r\n#Samples: 40\r\n\r\n"
    "Time (s),Channel 1 (V),Channel 2 (V)\r\n" + table(T, X, Y).replace("\n", "\r\n"),
    "labview.lvm": "LabVIEW Measurement\t\nWriter_Version\t2\nSeparator\tTab\nDecimal_Separator\t,\nX_Columns\tOne\n"
    "Date\t2024/03/21\nTime\t09:37:08,1234\n***End_of_Header***\t\n\t\nChannels\t2\t\t\nSamples\t40\t40\t\n"
    "Y_Unit_Label\tVolts\tVolts\t\nX_Dimension\tTime\tTime\t\nX0\t0\t0\t\nDelta_X\t0,001000\t0,001000\t\n"
    "***End_of_Header***\t\t\t\nX_Value\tVoltage\tVoltage 1\tComment\n" + table(de(T), de(X), de(Y), mark="\t"),
    "tracker.txt": "\tmass A\t\nt\tx\ty\n"
    + table([f"{t:.3E}" for t in T], [f"{x:.3E}" for x in X], [f"{y:.3E}" for y in Y], mark="\t"),
    "imagej.csv": " ,Label,Area,Height,Slice\n"
    + "\n".join(
        f"{k + 1},film.avi:{k + 1},{1000 + 10 * x:.1f},{y},{k + 1}" for k, x, y in zip(ROWS, X, Y, strict=True)
    ),
    "deeplabcut.csv": "scorer,net,net,net,net,net,net\nbodyparts,top,top,top,left,left,left\n"
    "coords,x,y,likelihood,x,y,likelihood\n"
    + "\n".join(
        f"{k},{300 + 9 * x:.3f},{120 + 9 * y:.3f},0.999,{250 + x:.3f},{120 + y:.3f},0.98"
        for k, x, y in zip(ROWS, X, Y, strict=True)
    ),
    "phyphox.csv": '"Time (s)","Acceleration x (m/s^2)","Absolute acceleration (m/s^2)"\n'
    + table(exp(T), exp(X), exp(Y)),
    "excel_german.csv": "sep=;\nZeit in s;Spannung [mV];Bemerkung\n"
    + "\n".join(
        f"{de([t], 3)[0]};{f'{1e4 * x:,.2f}'.translate(str.maketrans(',.', '.,'))};{'Start' if k == 0 else ''}"
        for k, t, x in zip(ROWS, T, X, strict=True)
    ),
    "logger_clock.csv": "Date/Time;Druck (mbar)\n"
    + "\n".join(
        f"21.03.2024 23:59:59,{980 + k:03d};{x:.4f}" if k < 20 else f"22.03.2024 00:00:00,{k - 20:03d};{x:.4f}"
        for k, x in zip(ROWS, X, strict=True)
    ),
    "blanks.dat": "% written by hand\n% rate: 1000\n   t / ms     V, mm3\n"
    + "\n".join(f"   {1e3 * t:8.3f}   {y:10.5f}" for t, y in zip(T, Y, strict=True)),
    "spectrum_dbm.csv": "Time [ms],Level [dBm]\n"
    + table([f"{1e3 * t:g}" for t in T], [round(-20 + 10 * x, 3) for x in X]),
}

if __name__ == "__main__":
    for name, text in FILES.items():
        (HERE / name).write_bytes((text + ("\r\n" if "\r\n" in text else "\n")).encode())
