component lockstep """The servo thread waits for whoever judges what it does.

Wall time means nothing then: however late the judge is, on however busy a computer, no more than some periods pass between two
of its looks. Read-only for the motion: it counts periods as ever and does not see that one began late.

halcompile --install lockstep.comp puts it among the modules (Debian: linuxcnc-uspace-dev).""";
pin out signed begun "Periods that have begun.";
pin in signed until "No period after this one begins; 0: nobody judges.";
pin out bit gone "The judge has not been heard for half a minute: nobody waits for it any more.";
option singleton yes;
function _ nofp;
license "GPL";
;;
#include <unistd.h>

#define NAP 100 /* microseconds */

FUNCTION(_) {
    int naps = 0;
    while (until > 0 && begun >= until && !gone) {
        usleep(NAP); /* where the thread can be ended, too */
        if (++naps > 30000000 / NAP)
            gone = 1;
    }
    begun = begun + 1;
}
