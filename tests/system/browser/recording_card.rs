//! The operator records: reads how long the disk lasts, starts, stops, and reads the result.

use parfocal_recording::Recording;

use super::driver::Driver;
use super::screenshots::shoot;
use super::theatre::operator;
use crate::support::Server;

#[tokio::test(flavor = "multi_thread")]
async fn the_operator_records_from_the_page() {
    let driver = Driver::start();
    let server = Server::with(&["--bind", "127.0.0.1:0", "--fps", "5"]);
    let operator = operator(&driver, &server).await;
    operator.sees("#recording-now", "Nothing is being recorded.").await;
    operator.sees("#recording-disk", "The disk lasts for about").await;

    operator.click("#record").await;
    operator.sees("#record", "Stop recording").await;
    operator.sees("#recording-now", "Recording mosaics: ").await;
    shoot(&operator, "operator-9-recording").await;

    operator.click("#record").await;
    operator.sees("#record", "Record mosaics").await;
    operator.sees("#recording-notice", "frames are saved in").await;
    shoot(&operator, "operator-10-recorded").await;

    let mut folders = std::fs::read_dir(server.data.path().join("recordings")).unwrap();
    let recording = Recording::open(&folders.next().unwrap().unwrap().path()).unwrap();
    assert!(recording.check().is_empty() && folders.next().is_none());
    assert_eq!(operator.complaints().await.iter().find(|text| text.contains("Uncaught")), None);
}
