"""Compare measured scans with predicted ones: match, explain, fit, locate, map, report.

    from sonarhw.log import read_log
    from sonarhw_compare import compare_readings
    from sonarhw_sim import load_board, load_room

    room = load_room("rooms/simple.toml")
    readings = read_log("scan.mcap").readings
    comparison = compare_readings(readings, room, room.place("figure9"), load_board("polaroid-6500"))
    comparison.summary().within_5cm  # share of the echoes

The names in `__all__` are public; they are loaded when they are first used. All modules are private and may change,
except `sonarhw_compare.study`, which needs the extra `study`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
