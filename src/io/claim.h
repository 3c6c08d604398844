/* To which process a temporary output belongs. It is written in the folder ".NAME.rx-NUMBER.tmp" beside its place, and as long
 * as the process that writes it lives, that process holds a lock (flock) on the empty file ".NAME.rx-NUMBER.lock":
 * what a killed one has left can be distinguished from the work of another process, and removed. The kernel drops the
 * lock with the process, so that neither process numbers nor names of machines have to be trusted. Where the file
 * system has no locks, no process gets one, and nothing is ever removed; where locks do not reach other machines (NFS
 * with local_lock), two machines must not write the same output at once. */
#ifndef RX_IO_CLAIM_H
#define RX_IO_CLAIM_H

/* Make `lock` and hold its lock. Returns the descriptor, for rx_claim_drop(), or -1 with errno: EEXIST when
 * another has it. */
int rx_claim_take(const char *lock);

/* Remove `lock` and let go of it. */
void rx_claim_drop(int claim, const char *lock);

/* Remove the temporaries of `path` whose processes are dead, with their locks; only what belongs to the user
 * of this process. `stem` is the common part of their names, up to ".rx-". A folder that stepped aside as
 * ".NAME.rx-NUMBER.tmp.old" for one that never came goes back to `path`. Failures are ignored. */
void rx_claim_sweep(const char *path, const char *stem);

#endif
