/* A plain loop over MuJoCo's steps, which scripts/bench.py compares everything with. */
#include <stddef.h>

#include <mujoco/mujoco.h>

/* Take n steps with commands (n, nu). A C program has no clock either: Python's package sets one. */
void steps(const mjModel *model, mjData *data, const double *ctrl, int n) {
  mjfTime clock = mjcb_time;
  mjcb_time = NULL;
  for (int k = 0; k < n; k++) {
    for (int i = 0; i < model->nu; i++) {
      data->ctrl[i] = ctrl[k * model->nu + i];
    }
    mj_step(model, data);
  }
  mjcb_time = clock;
}
