//! The operator's page says in words what is wrong with a lens.

use std::sync::Arc;

use parfocal_base::clock::SystemClock;
use parfocal_devices::lens::emulator::{Emulator, Fault, Model};

use super::driver::Driver;
use super::screenshots::shoot;
use super::theatre::operator;
use crate::support::Server;

#[tokio::test(flavor = "multi_thread")]
async fn the_operator_reads_what_is_wrong_with_the_lens() {
    let mut emulator = Emulator::start(Model::default(), Arc::new(SystemClock)).unwrap();
    let lens = format!("optotune:{}", emulator.path().display());
    let server = Server::with(&["--bind", "127.0.0.1:0", "--fps", "5", "--lens", &lens]);

    let driver = Driver::start();
    let operator = operator(&driver, &server).await;
    operator.sees("#devices", "Optotune lens").await;
    operator.sees_no("#warnings .bad").await;

    // A fault shows only when the lens is used.
    operator.select("#policy", "mgm-hill-climber").await;
    for (fault, words) in [
        (Fault::Silent, "nothing answers at"),
        (Fault::WrongChecksum, "checksum"),
        (Fault::Garbage, "unreadable"),
        (Fault::Errors, "does not know this command"),
        (Fault::DropsCommands, "does not go where it is sent"),
    ] {
        emulator.set_fault(fault);
        operator.sees("#warnings .bad", words).await;
        emulator.set_fault(Fault::None);
        operator.sees_no("#warnings .bad").await;
    }

    emulator.set_lens_present(false);
    operator.sees("#warnings .bad", "no lens is connected").await;
    emulator.set_lens_present(true);
    operator.sees_no("#warnings .bad").await;

    emulator.set_temperature(47.0);
    operator.sees("#warnings", "at 47.0 °C").await;
    shoot(&operator, "operator-9-hot-lens").await;
    emulator.set_temperature(25.0);

    emulator.unplug();
    operator.sees("#warnings .bad", "is the driver plugged in?; trying again").await;
    assert_eq!(operator.count("#warnings .bad").await, 1, "one trouble, one line");
    shoot(&operator, "operator-10-lens-unplugged").await;

    emulator.plug_in().unwrap();
    operator.sees_no("#warnings .bad").await;
    assert_eq!(operator.value("#policy").await, "mgm-hill-climber", "it goes on as before");
}
