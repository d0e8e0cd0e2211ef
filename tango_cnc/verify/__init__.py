"""Does the estimate predict what it has not seen? Held-out indexations, a CMM, a sphere, the whole working volume.

readings ──held_out──▶ residuals of touches that took no part in the estimate          (thesis Table 4-9)
estimate + CMM file ──cmm──▶ artefact and tip positions against another instrument     (Tables 4-7, 4-8)
sphere readings ──sphere──▶ out-of-sphericity, nominal against compensated             (chapter 6)
estimate ──volume──▶ error of the tool tip over the working volume, with its uncertainty and where it is a guess
"""
