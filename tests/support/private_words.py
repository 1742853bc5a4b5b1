"""The one list of words and names that this project once had for what the field has a word for.

docs/developing/naming.md has the glossary.

Each is an expression that ``tests/test_words.py`` looks for in the sources and pages. What replaced it stands beside it.
"""

#: In sources and pages: the expression, and what to write instead.
PHRASES = {
    r"(steps?|none) of chosen length": "adaptive steps",
    r"chosen steps?": "adaptive steps",
    r"kept states?": "saved states",
    r"films?": "animation",
    r"dear(er|est)?": "expensive",
    r"(step|one|those) beside the path": "extra step",
    r"abreast": "interleaved, vectors of a block",
    r"a lone \w+": "a single member",
    r"nobody|somebody|anybody|everybody|whoever": "the member, the caller, the thread, the value",
    r"who (diverged|tells|asks|is not finite)": "which members diverged",
    r"look(s|ing)? at": "check, read, evaluate",
    r"(two|one|last|next|first|more) looks?|looks (between|in between)": "check",
    r"held against": "compared with",
    r"(what|that) comes of": "result",
    r"is its own affair": "is computed by",
    r"in the place of": "in place of",
    r"unless told otherwise": "by default",
    r"pumps energy": "adds energy",
}

#: Identifiers of the Python package and the Rust core: the expression, and what it is called now.
NAMES = {
    r"(FEW|FAR|NEAR|MANY|MOST|OWN|LONG|RISES|QUICK|LOOKS)": "what the constant bounds",
    r"(WORTHWHILE|TOO_VAGUE|STILL|SURELY|BLUR|MET|TAKEN_UP|REMEMBERED)": "likewise",
    r"Paced(Lanes|Trials|State)?|LargePaced": "AdaptiveBatch, AdaptiveLanes, AdaptiveTrials, AdaptiveState, LargeAdaptive",
    r"Lone\w*|lone|LONE_\w+": "single",
    r"Aside|asides|aside(?=[:=])": "SideStage, extra step, background",
    r"Abreast|ABREAST": "block_vectors, ROWS_AT_ONCE",
    r"Loaded": "PreparedStage",
    r"foresee": "cache_forces",
    r"settle": "project, compile_now, store_next",
    r"(fn|def) (sit|tend|seat|beat)": "set_state, assign_member, update_lane",
    r"Seat|seats?": "Assignment",
    r"along::": "forces::",
    r"Crew|crew": "Workers, workers",
    r"Leave": "BusyGuard",
    r"heed": "set_stop_flag",
    r"(SHORT_)?LOOK|LOOKS_BETWEEN|PATIENCE|patience": "DIVERGENCE_CHECK_INTERVAL, steps_between_checks",
    r"WORTH_A?\w+|ALONE|TO_BEGIN|TEAM|STRAIGHT": "what the constant bounds: MIN_NUMBER_STEPS_FOR_THREADS, MAX_TAPE_OPERATIONS",
    r"(MOST_CODE|SINGLE_MAP|OF_A_NUMBER|OF_A_PARAMETER)": "MAX_CODE_OPERATIONS, BYTES_PER_NUMBER",
}

#: Where one may stand all the same: the end of a path, and the expression.
ALLOWED: set[tuple[str, str]] = set()
