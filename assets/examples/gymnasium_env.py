"""A STAIR task as a Gymnasium environment, with `stair env` as a child process.

    pip install gymnasium numpy
    python3 assets/examples/gymnasium_env.py push-green target/release/stair

plays one episode of random actions. In a program of your own:

    env = StairEnv("window-open", stair="target/release/stair")
"""

import json
import subprocess
import sys

import gymnasium
import numpy as np


class StairEnv(gymnasium.Env):
    """One task; close it when you are done."""

    metadata = {"render_modes": []}

    def __init__(self, task, stair="stair"):
        self._process = subprocess.Popen(
            [stair, "env", task],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self.stair_spec = self._ask({"spec": {}})
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
        self._process.stdin.close()
        self._process.wait()

    def _ask(self, request):
        self._process.stdin.write(json.dumps(request) + "\n")
        self._process.stdin.flush()
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"stair ended with code {self._process.wait()}")
        answer = json.loads(line)
        if "error" in answer:
            raise ValueError(answer["error"])
        return answer


def main():
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
