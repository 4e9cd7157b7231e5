"""Some frames of many characters, computed in this process; one bad character does not stop the others."""

from collections.abc import Callable, Sequence

from roam_motion.animator import CharacterState, FrameData, Intent

Step = Callable[[Sequence[CharacterState], Sequence[Intent]], list[tuple[CharacterState, FrameData]]]

Result = tuple[CharacterState, FrameData] | Exception

# States and, for each, the intents of its next frames -> for each its frames in order; where one fails, its error last.
Frames = Callable[[Sequence[CharacterState], Sequence[Sequence[Intent]]], Sequence[Sequence[Result]]]


def frames_of(
    step: Step, states: Sequence[CharacterState], intents: Sequence[Sequence[Intent]]
) -> Sequence[Sequence[Result]]:
    """`Frames` by one batched `step` after the other; all characters have equally many intents."""
    results: list[list[Result]] = [[] for _ in states]
    going = dict(enumerate(states))
    for frame in range(len(intents[0]) if intents else 0):
        stepped = _step_all(step, list(going.values()), [intents[index][frame] for index in going])
        for index, result in zip(list(going), stepped, strict=True):
            results[index].append(result)
            if isinstance(result, Exception):
                del going[index]
            else:
                going[index] = result[0]
    return results


def _step_all(step: Step, states: Sequence[CharacterState], intents: Sequence[Intent]) -> Sequence[Result]:
    try:
        return step(states, intents)
    except Exception as error:
        if len(states) == 1:
            return [error]
        return [_step_all(step, [state], [intent])[0] for state, intent in zip(states, intents, strict=True)]
