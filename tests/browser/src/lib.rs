//! The page in real browsers, driven through its own controls. The tests are in `tests/`; here is
//! what they share.

mod browser;
mod command;
mod page;
mod server;

pub use browser::Browser;
pub use command::{
    copy_folder, eval, eval_example, example_inputs, extract_keypoints, pack, parsed,
    same_keypoints, text, tracklens, tracklens_json, unpack,
};
pub use page::{EXAMPLE_FRAMES, EXAMPLE_KEYPOINTS, EXAMPLE_LENGTH, Page, example, site};
pub use server::Server;

/// Makes a test of every function `async fn(Browser)`, in Chromium and in Firefox.
#[macro_export]
macro_rules! in_every_browser {
    ($($test:ident)*) => { $(
        mod $test {
            #[tokio::test(flavor = "multi_thread")]
            async fn in_chromium() {
                super::$test($crate::Browser::Chromium).await;
            }

            #[tokio::test(flavor = "multi_thread")]
            async fn in_firefox() {
                super::$test($crate::Browser::Firefox).await;
            }
        }
    )* };
}
