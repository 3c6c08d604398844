/* Whose a temporary folder is: its marker file is locked (flock) as long as the process that makes it lives,
 * so that what a killed one has left can be told from the work of another process, and removed. */
#ifndef RX_IO_CLAIM_H
#define RX_IO_CLAIM_H

/* Write `text` to a new file `marker` in `folder`, locked from the moment it has its name. Returns its
 * descriptor, which holds the lock until it is closed, or -1 with errno. Where the file system has no locks
 * the file is made all the same, and the folder counts as claimed forever. */
int rx_claim_make(const char *folder, const char *marker, const char *text);

/* Before a folder `path` is made under `temporary`, ".NAME.rx-PID.tmp" beside it: remove those of killed
 * processes. What stepped aside as ".NAME.rx-PID.tmp.old" for a folder that never came goes back to `path`.
 * Failures are ignored. */
void rx_claim_sweep(const char *path, const char *temporary, const char *marker);

#endif
