"""What of the control itself mends a belief of `tango commission` where no key of the profile does: a setting, by its name.

{belief: (what to change, its source)}. Most names are remembered and say so: nobody has seen them on such a control.
"""

from __future__ import annotations

from collections.abc import Mapping

Remedies = Mapping[str, tuple[str, str]]
UNCONFIRMED = "unconfirmed: remembered"
OWN = "docs/dialects.md; unconfirmed that nothing else ends it"
SOURCES = "sources of gnea/grbl 1.1h and grblHAL"
OWN_FILE = (
    "the end mark is the last line that the program writes: a file that ends before it was copied too early, or its disk is full"
)

MACRO_B: Remedies = {
    "mirror": (
        "mirror image: its page of the settings and its switch; G50.1 and G50 in MDI where a program has left G51.1 or G51 on",
        UNCONFIRMED,
    ),
    "miss": (
        "G31 itself says nothing of a miss: an alarm comes from a word of the builder in its place",
        "B-63614EN p. 322 on the miss; the rest unconfirmed",
    ),
    "records": (
        "ISO code for the port (parameter 0000#1 ISO; 20, 101 and 103 are port, form and baud rate); a comma in place of the "
        "point comes from a converter on the line: no Fanuc prints one",
        UNCONFIRMED,
    ),
    "override": (
        "feed hold: #3004 is 0 and #3003 is 0; one of both that a program has left on holds it off until reset",
        UNCONFIRMED,
    ),
    "end": (
        "PCLOS ends what the port sends (DC4): handshake DC3/DC4 of the port, parameters 20 and 101; with a data server the "
        "file is closed at reset",
        UNCONFIRMED,
    ),
}
FANUC = MACRO_B
BROTHER: Remedies = {
    **MACRO_B,
    "records": ("output by Ethernet or RS-232, and its form, on the page of the communication parameters", UNCONFIRMED),
    "end": ("the file of DPRNT is closed by PCLOS; fetch it after the program has ended", UNCONFIRMED),
}
HAAS: Remedies = {
    **MACRO_B,
    "mirror": (
        "Settings 45 to 48 (mirror image of X, Y, Z, A) are OFF; G50 and G101 in MDI where a program has left G51 or mirror "
        "image on",
        UNCONFIRMED,
    ),
    "frames": (
        "RESET, or G255 in MDI, takes a dynamic work offset G254 off, as LIST PROGRAM, M02 and M30 do",
        "UMC-750 operator's manual p. 40",
    ),
    "widths": ("none is known: a field of DPRNT grows with its number; look at what copies the file", "96-8000 p. 116"),
    "alive": (
        "the probe is wired to the skip input of the I/O board: there is one, and G31 has no P. M59 P1134 has to switch it on",
        UNCONFIRMED,
    ),
    "records": (
        "Settings 11 to 14, 24, 25 and 37 of the port; Setting 261 to 263 where DPRNT goes",
        "96-8000 p. 115; numbers unconfirmed",
    ),
    "end": ("PCLOS sends DC4 where Setting 14 is DC CODES; with Setting 261 on File the file is closed by it", UNCONFIRMED),
}
MITSUBISHI: Remedies = {
    **MACRO_B,
    "miss": (
        "G31 completes at its end point and says nothing: an alarm comes from a macro of the builder",
        "M700V p. 547; the rest unconfirmed",
    ),
    "records": ("the I/O parameters of the port (9001 and on): parity, EIA or ISO, CR and LF", UNCONFIRMED),
    "end": ("PCLOS; the I/O parameters of the port, DC codes", UNCONFIRMED),
}
MAZAK: Remedies = {
    **MITSUBISHI,
    "records": ("parameters of DPR (DPRNT output) of the page of the I/O parameters: DPR1 and on", UNCONFIRMED),
    "end": ("PCLOS; parameters DPR of the I/O page say where it goes and whether a file is closed", UNCONFIRMED),
}
CENTROID: Remedies = {
    "deflected": (
        "the program looks at the input of machine parameter 11: it is the one that the probe is wired to, negative where it opens",
        "macros of Centroid",
    ),
    "mirror": ("scaling and mirror image off: G50 in MDI", UNCONFIRMED),
    "alive": (
        "machine parameter 11: the number of the input that the probe is wired to, negative where it opens",
        "macros of Centroid",
    ),
    "frames": ("the machine's own units are millimeters: Setup, Config, Control, and scaling and mirror image off", UNCONFIRMED),
    "miss": ("M115 … L1 goes on when nothing is met; a version of the control without L1 has to be updated", "operator's manual"),
    "records": ("region of Windows: decimal symbol is the point", UNCONFIRMED),
    "widths": ("none is known: M223 prints a number whole; look at what copies the file", UNCONFIRMED),
    "orientation": (
        "M19 is a macro of your own (mfunc19.mac): write it, or state orient: '' with one angle in strategy.yaml",
        "operator's manual",
    ),
    "override": ("feed hold of the operator panel: the PLC program has to let it act on M115 and M125", UNCONFIRMED),
    "end": (OWN_FILE, OWN),
}
FAGOR: Remedies = {
    "deflected": (
        "the program looks at probe_state (V.G.PRBST1 or V.G.PRBST2): it and probe_input name the input that the probe is wired to",
        UNCONFIRMED,
    ),
    "miss": (
        "G100 that ends without the probe is an error in some versions; which parameter allows it is not known: ask the maker",
        UNCONFIRMED,
    ),
    "mirror": ("mirror image and scaling off: G10 and G72 S1 in MDI, see the programming manual", UNCONFIRMED),
    "frames": ("cancel mirror image G11, G12, G13, pattern rotation G73 and scaling G72 in reset", UNCONFIRMED),
    "records": ("conversion: the letter after % of a number with a point; #WRITE prints a point", UNCONFIRMED),
    "widths": ("none is known: #WRITE prints a number whole; look at what copies the file", UNCONFIRMED),
    "override": ("feed hold: the PLC mark _FEEDHOL has to act on G100 too", UNCONFIRMED),
    "end": (OWN_FILE, OWN),
}
GRBL: Remedies = {
    "deflected": (
        "the driver asks for the probe in the status (? shows Pn:P while it is touched): the probe pins of the board, and $6",
        SOURCES,
    ),
    "mirror": ("G50 takes the scaling of G51 off; $G names it while it is on, and nothing is sent until it is off", SOURCES),
    "alive": (
        "the probe is at the probe pins of the board; $6 turns its polarity round, and ? shows Pn:P while it is touched",
        SOURCES,
    ),
    "miss": (
        "the probe pin: a filter or a shielded cable, as it flickers at the end of a move; $6, $19",
        f"{SOURCES}; unconfirmed: the cause",
    ),
    "orientation": (
        "a plugin that knows M19 R; else orient: '' with one angle in strategy.yaml, and no orient=m19 in the port's URL",
        SOURCES,
    ),
    "override": ("feed hold is !, and the button of it has to be at the feed hold pin: $14 turns its polarity round", SOURCES),
}
HEIDENHAIN: Remedies = {
    "deflected": (
        "the control itself refuses to probe with a deflected stylus: input X12, X112 or X113, and the row in the probe table",
        UNCONFIRMED,
    ),
    "alive": (
        "the probe is at the input of the touch probe (X12, X112 or X113), and its row in the probe table is the active one",
        UNCONFIRMED,
    ),
    "mirror": ("cycle 26 in MDI with the factor 1 for every axis, or select the program anew", UNCONFIRMED),
    "frames": (
        "basic rotation of the active line of the preset table: 0; scaling and mirror image off",
        "cycles 7, 8, 10, 11 do not undo it: unconfirmed",
    ),
    "miss": (
        "TCH PROBE 4 says -1 of a probe that meets nothing and makes no error; ERRORMODE is a word of TCH PROBE 3. Where it does "
        "make one, ask the builder for what stands behind the cycle",
        UNCONFIRMED,
    ),
    "records": ("TOCHAR prints a point: look at what copies the file; a setting of FN 16 is not known", UNCONFIRMED),
    "widths": ("none is known: TOCHAR makes a number whole; look at what copies the file", UNCONFIRMED),
    "orientation": ("the builder's cycle 13 or M19 (CfgSpindle): else orient: false with one angle in strategy.yaml", UNCONFIRMED),
    "override": ("NC stop of the panel: it acts on touches unless the PLC program locks it", UNCONFIRMED),
    "end": ("the mask ends with M_CLOSE; fetch the file after the program has ended", "docs/dialects.md; M_CLOSE unconfirmed"),
}
LINUXCNC: Remedies = {
    "deflected": (
        "the program looks at motion.probe-input: net probe-in in HAL is the pin of the card that the probe is wired to",
        "g-code.adoc",
    ),
    "alive": ("net probe-in => motion.probe-input in HAL: the pin of the card that the probe is wired to", "g-code.adoc"),
    "frames": ("rotation of the coordinate system: G10 L2 P0 R0 in MDI; G92.1 takes off what G92 has left", "g-code.adoc"),
    "miss": (
        "G38.3 goes on after a miss; an alarm comes from a remap of G38 in the ini file: REMAP under [RS274NGC]",
        "remap.adoc",
    ),
    "records": ("LANG and LC_NUMERIC of whoever starts LinuxCNC: C or en_US.UTF-8", "unconfirmed: inferred, not tried"),
    "widths": ("none is known: (LOG,…) prints a number whole; look at what copies the file", "tried on 2.9"),
    "orientation": ("spindle.0.orient in HAL; else orient: false with one angle in strategy.yaml", "motion(9)"),
    "override": ("halui.program.pause or the pause button; motion.feed-hold acts unless M53 P0 has locked it", "g-code.adoc"),
    "end": (OWN_FILE, OWN),
}
MACH3: Remedies = {
    "deflected": (
        "the macros look at LED 825: Config, Ports and Pins, Input Signals: Probe is enabled, on port and pin of its cable",
        "Using Mach3Mill",
    ),
    "alive": (
        "Config, Ports and Pins, Input Signals: Probe is enabled, and port and pin are those of its cable",
        "Using Mach3Mill",
    ),
    "mirror": ("Scale of each axis on the settings page is 1 (G50), and no axis is reversed by its DRO scale", UNCONFIRMED),
    "frames": ("Config, Select Native Units: millimeters; scale factors of the axes are 1", "Using Mach3Mill"),
    "miss": ("G31 says nothing of a miss; an error comes from the plugin of the motion board: its probe options", UNCONFIRMED),
    "records": ("region of Windows: decimal symbol is the point", UNCONFIRMED),
    "widths": ("none is known: Format has room for all digits; look at what copies the file", UNCONFIRMED),
    "override": ("the plugin of the motion board: feed hold has to act on G31", UNCONFIRMED),
    "end": (OWN_FILE, OWN),
}
MACH4: Remedies = {
    "deflected": (
        "the script looks at ISIG_PROBE: map Input Signals, Probe (G31), to the input of its cable. probe_state: false: no look",
        UNCONFIRMED,
    ),
    "alive": ("Configure, Control, Input Signals: Probe (G31) is mapped to the input of its cable", UNCONFIRMED),
    "mirror": ("scaling and mirror image off: G50 in MDI", UNCONFIRMED),
    "frames": ("Configure, Control, Machine Units: millimeters; scaling and mirror image off in reset", UNCONFIRMED),
    "miss": (
        "G31 says nothing of a miss; an error comes from the plugin of the motion board: its probe options",
        "Mill GCode Programming p. 94; the rest unconfirmed",
    ),
    "records": ("region of Windows: decimal symbol is the point", UNCONFIRMED),
    "widths": ("none is known: the script prints a number whole; look at what copies the file", UNCONFIRMED),
    "override": ("the plugin of the motion board: feed hold has to act on G31", UNCONFIRMED),
    "end": (OWN_FILE, OWN),
}
OKUMA: Remedies = {
    "mirror": (
        "mirror image off, at the panel and where a program has left G62 on; G50 in MDI where one has left G51 on",
        UNCONFIRMED,
    ),
    "widths": ("none is known: places: 11 or 12 gives PUT more room; look at what copies the file", UNCONFIRMED),
    "alive": (
        "the skip input that the probe is wired to; which it is, the builder says. Another skip word goes into skip",
        UNCONFIRMED,
    ),
    "frames": ("the base of VSAP: a work offset or a tool length that G15 H0 leaves in; cancel it before the start", UNCONFIRMED),
    "miss": (
        "G31 that ends without a signal is an alarm by an optional parameter; its number is not known: ask the maker",
        UNCONFIRMED,
    ),
    "records": ("PUT prints a point where the unit system is 1 mm, by an optional parameter; its number is not known", UNCONFIRMED),
    "override": ("slide hold of the panel: it acts on G31 unless the builder has locked it", UNCONFIRMED),
    "end": ("CLOSE C ends the file; fetch it after the program has ended", "unconfirmed: programs of users"),
}
SIEMENS: Remedies = {
    "deflected": (
        "the program looks at $A_PROBE of probe_input: state the one that the probe is wired to. probe_state: false: no look",
        UNCONFIRMED,
    ),
    "frames": (
        "set to inches: MD10240, or metric_check: false where G710 is known to give mm. A transformation, work offset or frame is "
        "on: set the basic frames of the channel and the global ones to 0, take swivel data and a set zero point off, DRF by DRFOF "
        "in MDI; frame_check: false where they have to stay, and SUPA is proven. Latched position does not fit: MEAS has latched "
        "another input, or nothing (probe_input, MD13200)",
        "PGA 04.00 on $P_ACTFRAME; the rest unconfirmed",
    ),
    "rotary": (
        "a control that does not take $VA_IM or $AA_MM with these letters: state machine_axes, e.g. {B: B1}; exact stop coarse "
        "(MD20550) or MD36010 above 0.01 deg: the axis is read before it stands",
        "PGA 04.00 p. 15-560 on the names; the rest unconfirmed",
    ),
    "miss": (
        "MEAS itself says nothing of a miss: an alarm comes from a cycle or a synchronized action of the builder",
        UNCONFIRMED,
    ),
    "records": ("SPRINT prints a point; with EXTOPEN look at the other side: who writes the share, and its code page", UNCONFIRMED),
    "widths": ("none is known: SPRINT %.4F prints a number whole; look at what copies the file", UNCONFIRMED),
    "orientation": (
        "SPOS needs a spindle that is referenced and under position control (MD30300, MD35300); else orient: false with one angle",
        UNCONFIRMED,
    ),
    "override": (
        "feed stop of the panel: the PLC program sets DB21.DBX6.0 (feed disable) by it; it acts on MEAS blocks, which are G1",
        UNCONFIRMED,
    ),
    "end": ("EXTCLOSE ends the file; it is closed at M30 and reset too: fetch it then", "Siemens 90277867"),
}
