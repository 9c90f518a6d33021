#!/bin/bash
# Boots a systemd of its own, in namespaces of its own, with the nodes of the unit under test.
# Nothing of it is seen outside; /run/test inside is the folder outside.
#
#   systemd.sh FOLDER KERF TEST UNIT   as root
set -euo pipefail
folder=$1 kerf=$2 test=$3 unit=$4

if [ "${5-}" != inside ]; then
  # Control groups of its own, so that it is no matter of the systemd of this computer.
  for tree in /sys/fs/cgroup/{systemd,memory,pids,unified,}; do
    [ -e "$tree/cgroup.procs" ] || continue
    mkdir -p "$tree/kerf-test-$$"
    echo $$ > "$tree/kerf-test-$$/cgroup.procs"
  done
  exec unshare --cgroup --fork --kill-child --pid --mount --net --ipc --uts --propagation private \
    "$BASH" "$0" "$folder" "$kerf" "$test" "$unit" inside
fi

ip link set lo up
# The system as it is, and what is written to it in memory.
mount -t tmpfs -o size=1g tmpfs /mnt
mkdir /mnt/{upper,work,root}
mount -t overlay -o lowerdir=/,upperdir=/mnt/upper,workdir=/mnt/work overlay /mnt/root
cd /mnt/root
mount -t proc proc proc
mount -t sysfs -o ro sysfs sys
if [ -e /sys/fs/cgroup/cgroup.procs ]; then
  mount -t cgroup2 cgroup2 sys/fs/cgroup
else
  mount -t tmpfs -o mode=755 tmpfs sys/fs/cgroup
  mkdir sys/fs/cgroup/{systemd,memory,pids,unified}
  mount -t cgroup -o none,name=systemd cgroup sys/fs/cgroup/systemd
  for tree in memory pids; do mount -t cgroup -o $tree cgroup sys/fs/cgroup/$tree; done
  mount -t cgroup2 cgroup2 sys/fs/cgroup/unified
fi
for place in run dev; do mount -t tmpfs -o mode=755 tmpfs $place; done
for device in null zero full random urandom tty; do
  touch dev/$device
  mount --bind /dev/$device dev/$device
done
mkdir dev/pts dev/shm run/test
mount -t tmpfs -o mode=1777 tmpfs dev/shm
mount -t devpts -o newinstance,ptmxmode=0666,mode=620 devpts dev/pts
ln -s pts/ptmx dev/ptmx
ln -s /proc/self/fd dev/fd
mount --bind "$folder" run/test
touch usr/bin/kerf usr/bin/kerf-test
mount --bind "$kerf" usr/bin/kerf
mount --bind "$test" usr/bin/kerf-test
mount -t tmpfs -o mode=1777 tmpfs tmp
mkdir -p etc/kerf etc/systemd/system
cp "$unit" etc/systemd/system/kerf-node@.service
cp run/test/*.service run/test/*.target etc/systemd/system
cp run/test/kerf.yaml run/test/environment etc/kerf
chroot . useradd --system --no-create-home kerf
echo 0123456789abcdef0123456789abcdef > etc/machine-id
mkdir -p old
pivot_root . old
umount -l old
exec env -i container=kerf-test PATH=/usr/sbin:/usr/bin:/sbin:/bin \
  /lib/systemd/systemd --system --unit=kerf-test.target --log-target=journal < /dev/null
