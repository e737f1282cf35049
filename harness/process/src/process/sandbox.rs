//! What an engine may do on Linux. Landlock: it reads what the user may read, writes below its own folders alone, signals only what it
//! started. Seccomp: it has no sockets but Unix ones, sets no limits of other processes, shares no memory, messages and keys with them, changes no
//! permissions, owners and times of files, types nothing into a terminal.

use std::path::{Path, PathBuf};

use landlock::{
    ABI, Access, AccessFs, AccessNet, LandlockStatus, RestrictionStatus, Ruleset, RulesetAttr, RulesetCreatedAttr,
    RulesetError, RulesetStatus, Scope, path_beneath_rules,
};

/// What is asked for: an older kernel gives what it has of it.
const WANTED: ABI = ABI::V6;
/// The first version that keeps programs from the network.
const NETWORK: ABI = ABI::V4;

/// Devices that hold nothing.
const DEVICES: [&str; 2] = ["/dev/null", "/dev/zero"];

/// Confines the calling thread, and all that it starts from then on.
pub(super) fn enter(writable: &[PathBuf]) -> (Result<RestrictionStatus, RulesetError>, Result<(), calls::Error>) {
    // What the one cannot do is no reason to leave out the other.
    (restrict_files(writable), calls::restrict())
}

fn restrict_files(writable: &[PathBuf]) -> Result<RestrictionStatus, RulesetError> {
    let everything = AccessFs::from_all(WANTED);
    Ruleset::default()
        .handle_access(everything)?
        .handle_access(AccessNet::from_all(NETWORK))?
        .scope(Scope::from_all(WANTED))?
        .create()?
        .add_rules(path_beneath_rules(["/"], AccessFs::from_read(WANTED)))?
        .add_rules(path_beneath_rules(writable, everything))?
        .add_rules(path_beneath_rules(DEVICES, AccessFs::from_file(WANTED)))?
        .restrict_self()
}

/// Takes the files below some folders from the calling thread and all that it starts from then on, except those below `visible`. Nothing
/// else is restricted: names of files can still be listed.
///
/// Landlock only knows what is allowed, so everything next to the path of each hidden folder is. What is created there later, directly in a
/// folder above a hidden one, cannot be read back.
pub(super) fn hide(hidden: &[PathBuf], visible: &[PathBuf]) -> Result<RestrictionStatus, RulesetError> {
    let hidden: Vec<PathBuf> = hidden.iter().map(|folder| real(folder)).collect();
    let mut readable = vec![];
    list_around(Path::new("/"), &hidden, &mut readable);
    readable.extend(visible.iter().cloned());
    Ruleset::default()
        .handle_access(AccessFs::ReadFile)?
        .create()?
        .add_rules(path_beneath_rules(readable, AccessFs::ReadFile))?
        .restrict_self()
}

/// The place that a path leads to, also where its last parts do not exist yet.
fn real(path: &Path) -> PathBuf {
    let existing = path.ancestors().find_map(|above| Some((above, above.canonicalize().ok()?)));
    let Some((above, real)) = existing else { return path.to_owned() };
    path.strip_prefix(above)
        .map_or_else(|_| real.clone(), |rest| if rest.as_os_str().is_empty() { real.clone() } else { real.join(rest) })
}

/// Adds what lies in a folder and is not, and does not hold, a hidden folder.
fn list_around(folder: &Path, hidden: &[PathBuf], readable: &mut Vec<PathBuf>) {
    for entry in folder.read_dir().into_iter().flatten().flatten() {
        let path = entry.path();
        // A link leads where it leads: what it shows is allowed or hidden at its own place.
        if entry.file_type().is_ok_and(|kind| kind.is_symlink()) {
            continue;
        }
        if hidden.contains(&path) {
            continue;
        }
        if hidden.iter().any(|folder| folder.starts_with(&path)) {
            list_around(&path, hidden, readable);
        } else {
            readable.push(path);
        }
    }
}

/// What confines engines on this machine, in words; tried by a thread that ends.
pub(super) fn in_words() -> String {
    let Ok((files, calls)) = std::thread::spawn(|| enter(&[])).join() else {
        return "off: it could not be tried".to_owned();
    };
    let calls = match calls {
        Ok(()) => "seccomp: no network, no change of permissions".to_owned(),
        Err(error) => format!("seccomp off: {error}"),
    };
    let files = match files {
        Ok(RestrictionStatus { ruleset: RulesetStatus::FullyEnforced, .. }) => {
            "on (Landlock): engines write below their own folders alone".to_owned()
        }
        Ok(RestrictionStatus { ruleset: RulesetStatus::PartiallyEnforced, landlock, .. }) => {
            format!("on in part: {}, and all of it needs Linux 6.12", version(landlock))
        }
        Ok(RestrictionStatus { landlock, .. }) => format!("off: {}", version(landlock)),
        Err(error) => format!("off: {error}"),
    };
    format!("{files}; {calls}")
}

fn version(landlock: LandlockStatus) -> String {
    match landlock {
        LandlockStatus::NotImplemented => "this kernel has no Landlock, which came with Linux 5.13".to_owned(),
        LandlockStatus::NotEnabled => "this kernel was started without Landlock (`lsm=landlock,...`)".to_owned(),
        LandlockStatus::Available { effective_abi, .. } => {
            format!("this kernel has version {} of Landlock", effective_abi as i32)
        }
    }
}

/// System calls that Landlock knows nothing of.
mod calls {
    use std::collections::BTreeMap;

    use nix::libc;
    use seccompiler::{
        BackendError, BpfProgram, SeccompAction, SeccompCmpArgLen, SeccompCmpOp, SeccompCondition, SeccompFilter,
        SeccompRule, apply_filter,
    };

    pub(in super::super) use seccompiler::Error;

    type Rules = BTreeMap<i64, Vec<SeccompRule>>;

    /// Numbers of calls of x86-64's second interface are those of the first with this bit.
    #[cfg(target_arch = "x86_64")]
    const X32: i64 = 0x4000_0000;

    /// Refuses what reaches others, and lets pass without effect what changes permissions: programs that copy files do not expect that to
    /// fail.
    pub(super) fn restrict() -> Result<(), Error> {
        let refused = SeccompAction::Errno(libc::EPERM as u32);
        for (rules, action) in [(reaching_others()?, refused), (of_permissions(), SeccompAction::Errno(0))] {
            let arch = std::env::consts::ARCH.try_into()?;
            let filter = SeccompFilter::new(with_x32(rules), SeccompAction::Allow, action, arch)?;
            let program: BpfProgram = filter.try_into()?;
            apply_filter(&program)?;
        }
        Ok(())
    }

    /// The condition that a socket is not of this family.
    fn other_family(number: i32) -> Result<SeccompCondition, BackendError> {
        SeccompCondition::new(0, SeccompCmpArgLen::Dword, SeccompCmpOp::Ne, u64::from(number.unsigned_abs()))
    }

    /// The calls that reach other processes or machines.
    ///
    /// These are sockets except Unix and netlink ones, limits of other processes, and `io_uring`.
    /// `io_uring` makes calls that no filter sees.
    fn reaching_others() -> Result<Rules, BackendError> {
        let socket = SeccompRule::new(vec![other_family(libc::AF_UNIX)?, other_family(libc::AF_NETLINK)?])?;
        // The call reads its own limits where the process (0) and the new limits (2) are zero.
        let other = SeccompCondition::new(0, SeccompCmpArgLen::Dword, SeccompCmpOp::Ne, 0)?;
        let sets = SeccompCondition::new(2, SeccompCmpArgLen::Qword, SeccompCmpOp::Ne, 0)?;
        let rules = Rules::from([
            (libc::SYS_socket, vec![socket]),
            (libc::SYS_prlimit64, vec![SeccompRule::new(vec![other, sets])?]),
            (libc::SYS_io_uring_setup, vec![]),
            (libc::SYS_ioctl, REFUSED_IOCTLS.map(ioctl).into_iter().collect::<Result<_, _>>()?),
        ]);
        Ok(rules.into_iter().chain(SHARED.map(|call| (call, vec![]))).collect())
    }

    /// Device calls for which a descriptor to read with is enough. Two set flags of a file (`FS_IOC_SETFLAGS`, `FS_IOC_FSSETXATTR`).
    /// Two type into the user's terminal (`TIOCSTI`, and `TIOCLINUX` on a console); Landlock refuses them from Linux 6.10 on.
    const REFUSED_IOCTLS: [u64; 4] = [0x4008_6602, 0x401c_5820, 0x5412, 0x541c];

    fn ioctl(request: u64) -> Result<SeccompRule, BackendError> {
        SeccompRule::new(vec![SeccompCondition::new(1, SeccompCmpArgLen::Dword, SeccompCmpOp::Eq, request)?])
    }

    /// Memory, messages, semaphores and keys that all processes of a user share by number, not by a file.
    const SHARED: [i64; 16] = [
        libc::SYS_shmget,
        libc::SYS_shmat,
        libc::SYS_shmctl,
        libc::SYS_msgget,
        libc::SYS_msgsnd,
        libc::SYS_msgrcv,
        libc::SYS_msgctl,
        libc::SYS_semget,
        libc::SYS_semop,
        libc::SYS_semtimedop,
        libc::SYS_semctl,
        libc::SYS_mq_open,
        libc::SYS_mq_unlink,
        libc::SYS_add_key,
        libc::SYS_request_key,
        libc::SYS_keyctl,
    ];

    /// Permissions, owners, times and attributes of files, which Landlock leaves to their owner.
    fn of_permissions() -> Rules {
        const FCHMODAT2: i64 = 452;
        const SETXATTRAT: i64 = 463;
        const REMOVEXATTRAT: i64 = 466;
        const FILE_SETATTR: i64 = 469;
        let everywhere = [
            libc::SYS_fchmod,
            libc::SYS_fchmodat,
            FCHMODAT2,
            SETXATTRAT,
            REMOVEXATTRAT,
            FILE_SETATTR,
            libc::SYS_utimensat,
            libc::SYS_fchown,
            libc::SYS_fchownat,
            libc::SYS_setxattr,
            libc::SYS_lsetxattr,
            libc::SYS_fsetxattr,
            libc::SYS_removexattr,
            libc::SYS_lremovexattr,
            libc::SYS_fremovexattr,
        ];
        #[cfg(target_arch = "x86_64")]
        let here = [
            libc::SYS_chmod,
            libc::SYS_chown,
            libc::SYS_lchown,
            libc::SYS_utime,
            libc::SYS_utimes,
            libc::SYS_futimesat,
        ];
        #[cfg(not(target_arch = "x86_64"))]
        let here = [];
        everywhere.into_iter().chain(here).map(|call| (call, vec![])).collect()
    }

    #[cfg(target_arch = "x86_64")]
    fn with_x32(rules: Rules) -> Rules {
        let second: Rules = rules.iter().map(|(call, rules)| (call | X32, rules.clone())).collect();
        rules.into_iter().chain(second).collect()
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn with_x32(rules: Rules) -> Rules {
        rules
    }
}
