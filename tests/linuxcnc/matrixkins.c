/* Kinematics of LinuxCNC for the tests: joints = C * axes of X Y Z, all further axes as they are.

   These are our own kinematics, written from the manual page matrixkins(9) of LinuxCNC alone: its equations, the names C_xx .. C_zz,
   the identity to begin with, and that a change acts at run time. Debian's LinuxCNC has no matrixkins; where the control has its own,
   use that one. `halcompile --install matrixkins.c` puts it among the modules (Debian: linuxcnc-uspace-dev). */

#include "rtapi.h"
#include "rtapi_app.h"
#include "rtapi_math.h"
#include "hal.h"
#include "kinematics.h"

MODULE_LICENSE("GPL"); /* what LinuxCNC asks of a module that it loads */

static int component;
static struct {
    hal_float_t c[3][3]; /* row: joint, column: axis */
} *matrix;

/* The determinant of C without row r and column k, signs as in the inverse. */
static double cofactor(int r, int k)
{
    int r1 = (r + 1) % 3, r2 = (r + 2) % 3, k1 = (k + 1) % 3, k2 = (k + 2) % 3;
    return matrix->c[r1][k1] * matrix->c[r2][k2] - matrix->c[r1][k2] * matrix->c[r2][k1];
}

int kinematicsInverse(const EmcPose *world, double *joint, const KINEMATICS_INVERSE_FLAGS *from, KINEMATICS_FORWARD_FLAGS *to)
{
    const double axis[3] = {world->tran.x, world->tran.y, world->tran.z};
    const double further[6] = {world->a, world->b, world->c, world->u, world->v, world->w};
    int i, k;
    for (i = 0; i < 3; i++) {
        joint[i] = 0.0;
        for (k = 0; k < 3; k++)
            joint[i] += matrix->c[i][k] * axis[k];
    }
    for (i = 0; i < 6; i++)
        joint[3 + i] = further[i];
    return 0;
}

int kinematicsForward(const double *joint, EmcPose *world, const KINEMATICS_FORWARD_FLAGS *from, KINEMATICS_INVERSE_FLAGS *to)
{
    const double det = matrix->c[0][0] * cofactor(0, 0) + matrix->c[0][1] * cofactor(0, 1) + matrix->c[0][2] * cofactor(0, 2);
    double axis[3];
    int i, k;
    if (fabs(det) < 1e-6)
        return -1;
    for (k = 0; k < 3; k++) {
        axis[k] = 0.0;
        for (i = 0; i < 3; i++)
            axis[k] += cofactor(i, k) * joint[i] / det;
    }
    world->tran.x = axis[0];
    world->tran.y = axis[1];
    world->tran.z = axis[2];
    world->a = joint[3];
    world->b = joint[4];
    world->c = joint[5];
    world->u = joint[6];
    world->v = joint[7];
    world->w = joint[8];
    return 0;
}

KINEMATICS_TYPE kinematicsType(void) { return KINEMATICS_BOTH; }
int kinematicsSwitchable(void) { return 0; }
int kinematicsSwitch(int type) { return type != 0; }
EXPORT_SYMBOL(kinematicsInverse);
EXPORT_SYMBOL(kinematicsForward);
EXPORT_SYMBOL(kinematicsType);
EXPORT_SYMBOL(kinematicsSwitchable);
EXPORT_SYMBOL(kinematicsSwitch);

int rtapi_app_main(void)
{
    int i, k;
    component = hal_init("matrixkins");
    if (component < 0)
        return component;
    matrix = hal_malloc(sizeof(*matrix));
    for (i = 0; i < 3; i++)
        for (k = 0; k < 3; k++) {
            if (!matrix || hal_param_float_newf(HAL_RW, &matrix->c[i][k], component, "matrixkins.C_%c%c", "xyz"[i], "xyz"[k]) < 0) {
                hal_exit(component);
                return -1;
            }
            matrix->c[i][k] = i == k;
        }
    return hal_ready(component);
}

void rtapi_app_exit(void) { hal_exit(component); }
