"""Does what cameras delivered give the same masks as the same pictures from files?"""
import pathlib
import shutil

import robot

MOST_TRIES = 3


def replayed(delivered, frames):
    """The masks of `groundline replay` on these frames (stamp in ns, frame number), in order."""
    folder = pathlib.Path("/tmp/delivered")
    shutil.rmtree(folder, ignore_errors=True)
    for view in ("left", "right"):
        (folder / view).mkdir(parents=True)
        for stamp_ns, number in delivered:
            picture = next((frames / view).glob(f"{number:03}.*"))
            (folder / view / f"{stamp_ns:019}{picture.suffix}").symlink_to(picture)
    shutil.copy(robot.FRAMES / "calib.txt", folder)
    log = pathlib.Path("/tmp/replay.log")
    log.unlink(missing_ok=True)
    robot.command("/w/bin/groundline", "replay", str(folder), "--quiet", "--lcm-url", f"file://{log}?mode=w",
                  "--set", f"mount.body_mask={robot.NUMBER_MASK}")
    return [robot.mask_t.decode(data) for channel, data in robot.events(log, 0) if channel == "GROUNDLINE_MASK"]


def what_matters(mask, overloaded):
    """All of a mask but when and where it came from; numbers that are not there are equal to each other.

    That the machine was too slow for the cameras is known to the daemon alone: it adds a reason and may cost trust.
    """
    left_out = ["utime", "stamp_source", "sequence"] + ["verdict"] * overloaded
    parts = {name: repr(getattr(mask, name)) for name in mask.__slots__ if name not in left_out}
    return parts | {"reasons": hex(mask.reasons & ~robot.mask_t.REASON_OVERLOAD)}


def one_try(stack, devices, settings, frames, form, feeds, least):
    """A sentence, or None where a mask was lost on its way here, so that nobody knows what was processed."""
    radio = robot.Radio(stack)
    daemon = robot.Daemon(stack, **devices, **settings, mount_body__mask=robot.NUMBER_MASK, publish_preview="on",
                          overload_half__resolution="never",
                          capture_calibration=robot.FRAMES / "calib.txt")
    feeder = robot.feed(stack, *feeds, form=form, rate=2)
    robot.until(lambda: len(radio.listen().masks) >= least or not feeder.running(), f"{least} masks", 300)
    # A mask goes out before the preview of its frame.
    robot.until(lambda: len(radio.listen().previews) >= least or not feeder.running(), f"{least} previews")
    health = radio.wait(lambda h: True, "health")
    daemon.end()
    feeder.kill()
    radio.kill(robot.signal.SIGINT)
    radio.listen()
    counted = robot.counters(health)
    if counted["results_overwritten"] or len(radio.previews) < len(radio.masks):
        return None
    numbers = {preview.utime: robot.frame_number(preview) for preview in radio.previews}
    delivered = [(mask.exposure_mono_ns, numbers[mask.utime]) for mask in radio.masks]
    robot.expect(len(delivered) >= least, f"only {len(delivered)} masks of {least}; {robot.told(health)}")
    order = [number for _, number in delivered]
    robot.expect(None not in order, "a picture came without a clear number: torn, or another one's")
    robot.expect(order == sorted(set(order)), f"frames came in a wrong order: {order}")
    expected = replayed(delivered, frames)
    robot.expect(len(expected) == len(delivered), f"{len(expected)} masks of {len(delivered)} from files")
    for number, (mask, other) in enumerate(zip(radio.masks, expected)):
        overloaded = bool(mask.reasons & robot.mask_t.REASON_OVERLOAD)
        mine, files = what_matters(mask, overloaded), what_matters(other, overloaded)
        differs = [name for name in mine if mine[name] != files[name]]
        robot.expect(not differs, f"mask {number} of frame {order[number]} is another one from files, in: "
                     + ", ".join(f"{name} {mine[name][:40]} / {files[name][:40]}" for name in differs))
    robot.expect(any(mask.verdict == robot.mask_t.VERDICT_TRUSTED for mask in expected), "no mask is trusted")
    return f"{len(delivered)} masks are those of the files; {order[-1] + 1 - len(order)} frames were skipped"


def judge(stack, devices, settings, frames, form, feeds, least=100):
    for _ in range(MOST_TRIES):
        with robot.contextlib.ExitStack() as inner:
            if sentence := one_try(inner, devices, settings, frames, form, feeds, least):
                return sentence
    raise robot.Failed(f"masks were lost in each of {MOST_TRIES} tries")
