"""A STAIR task as a Gymnasium environment, with `stair env` as a child process.

    pip install gymnasium numpy
    python3 assets/examples/gymnasium_env.py push-green target/release/stair

plays one episode of random actions. In a program of your own:

    env = StairEnv("window-open", stair="target/release/stair")
"""

import json
import subprocess
import sys
import tempfile

import gymnasium
import numpy as np


class StairEnv(gymnasium.Env):
    """One task; close it when you are done."""

    metadata = {"render_modes": []}

    def __init__(self, task, stair="stair"):
        # A file, not a pipe, which would block stair once it is full.
        self._errors = tempfile.TemporaryFile("w+")
        self._process = subprocess.Popen(
            [stair, "env", task],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
        )
        try:
            self.stair_spec = self._ask({"spec": {}})
        except BaseException:
            self.close()
            raise
        n_observed, n_acted = (
            self.stair_spec[size] for size in ("observation_size", "action_size")
        )
        self.observation_space = gymnasium.spaces.Box(-np.inf, np.inf, (n_observed,), np.float32)
        self.action_space = gymnasium.spaces.Box(-1.0, 1.0, (n_acted,), np.float32)

    def reset(self, *, seed=None, options=None):
        super().reset(seed=seed)
        # Without a seed of its own, an episode takes the next one of the generator.
        drawn = int(self.np_random.integers(2**32)) if seed is None else seed
        answer = self._ask({"reset": {"seed": drawn}})
        return np.array(answer["observation"], np.float32), {"seed": drawn}

    def step(self, action):
        answer = self._ask({"step": {"action": np.asarray(action, float).tolist()}})
        end = answer["end"]
        return (
            np.array(answer["observation"], np.float32),
            answer["task_reward"],
            end == "terminal",
            end == "time_limit",
            {"success": answer["success"]},
        )

    def close(self):
        if self._process.returncode is None:
            self._process.communicate()  # closes its input, which ends it, and waits
        self._errors.close()

    def _ask(self, request):
        try:
            self._process.stdin.write(json.dumps(request) + "\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            pass  # it has ended, as the missing answer tells
        line = self._process.stdout.readline()
        if not line:
            self._process.communicate()
            self._errors.seek(0)
            code, why = self._process.returncode, self._errors.read().strip()
            raise RuntimeError(f"stair ended with code {code}: {why}")
        answer = json.loads(line)
        if "error" in answer:
            raise ValueError(answer["error"])
        return answer


def main():
    if len(sys.argv) not in (2, 3):
        sys.exit(__doc__)
    env = StairEnv(*sys.argv[1:])
    env.action_space.seed(1)
    env.reset(seed=7)
    total, is_over, solved = 0.0, False, False
    while not is_over:
        _, reward, terminated, truncated, info = env.step(env.action_space.sample())
        total += reward
        solved |= info["success"]
        is_over = terminated or truncated
    print(f"return {total:.2f}, {'solved' if solved else 'not solved'}")
    env.close()


if __name__ == "__main__":
    main()
