# What surgeons read, in English. The format is Fluent: https://projectfluent.org/fluent/guide
# Every language has the same messages, with the same arguments: a test compares them (CONTRIBUTING.md).

## The surgeon's page: its fixed words

live-view = Live view
practice = Practice
reduced-picture = Reduced picture
pause = Pause
display = Display
show-patch = Show the spot that is kept in focus
show-edge = Show the edge of the view
show-sharp = Highlight what is sharp
brightness = Brightness around the picture
try-tablet = Try this tablet
not-a-device = For research. Not a medical device.
page-starting = Starting… If this line stays, load the page again. If it stays then, this browser is too old: iPadOS 16.4, Chrome 108, Firefox 121 or newer.
needs-javascript = This page needs JavaScript. Allow it for this address, then load the page again.
estimated-colours = Estimated colours: the sensor sees no red.
focus-buttons =
    .aria-label = Focus
centre = Centre
comments-area =
    .aria-label = Comments
quick-area =
    .aria-label = Quick comments
comment-box =
    .aria-label = Comment
    .placeholder = Write what you see
save-comment = Save comment
mark-moment = Mark this moment
done-with-setting = Done with this setting
tap-again = Tap again to finish
undo = Undo
tap-to-continue = Tap to continue

## The picture and the focus

view-help = Live view. Plus and minus zoom, zero shows everything.
view-help-pointing = { view-help } Where it is allowed, Shift with an arrow points the focus, and C brings it back to the centre.
show-all = { NUMBER($zoom, minimumFractionDigits: 1, maximumFractionDigits: 1) }× · Show all
picture-not-live = The picture is not live
picture-live-again = The picture is live again
picture-first = Waiting for the first picture
picture-old = Not live: the picture is more than half a second old
picture-old-seconds = Not live: the picture is { $seconds } seconds old
picture-old-minutes = Not live: the picture is { $minutes } minutes old
picture-connecting = { $state } · connecting
hold-focus = Hold focus
focus-held = Focus held
not-pointed-server = The server does not answer, so the focus was not moved.
not-pointed-live = The picture is not live, so the focus was not moved.
simulated-camera = Simulated camera
simulated-lens = Simulated lens
simulated-both = Simulated camera and lens
camera-failed = The camera is not delivering pictures.
lens-failed = The focus is being held for the moment.

## What to do now

now-scan-code = Scan the operator’s code to open the next session.
now-connecting = Connecting to the server…
now-nothing = Nothing to do yet: wait for the operator to start a trial.
now-press-continue = Press “Continue” when you are ready.
now-wait-paused = Wait for the operator. You can still comment.
now-wait-start = Wait for the operator to start the trial.
now-tap-begin = Tap to begin setting { $setting }.
now-ends-soon = This setting ends in a moment. What you are writing stays.
now-look-write = Look around and write what you notice. Then finish the setting.
now-look-say = Look around and say or write what you notice. Then finish the setting.
now-answer = Answer the questions, then press “Continue”.
now-answer-last = Answer the last questions, then press “Finish”.
now-keep-open = Keep this page open until everything is saved.
now-comment-left = Save or delete the comment in the box.
now-practice-over = Practice is over. Keep the tablet: the trial comes next.
now-done = You are done. Give the tablet back.
now-unreachable = The server cannot be reached.
now-silent-since = No server since { $time }.
now-certificate-over = Its certificate has ended: tell the operator.
now-keeps-trying = This page keeps trying.
now-comment-on = Comments are saved here and sent later.

## The session

setting-of = Setting { $setting } of { $settings }
time-left = { $time } left
paused = Paused
paused-by-you = You have paused the session. You can still comment.
paused-by-restart = The server was restarted. { $saved } Continue where you were.
paused-by-absence = This tablet was away, so the session was paused. { $saved } Continue where you were.
paused-by-picture = The picture was too small for this trial, so it was paused. Continue once it is better.
paused-by-operator = The operator has paused the session. You can still comment.
ready =
    { $settings ->
        [one] You will look at one setting. The operator will start the trial.
       *[other] You will look at { $settings } settings, one after another. The operator will start the trial.
    }
no-trial = No trial is under way. You can look around.
not-open-here = Not open to this tablet
few-questions = Setting { $setting }: a few questions
final-questions = Final questions
practice-over = Practice is over
practice-over-more = That was practice; it does not count. { $kept }
thank-you = Thank you
trial-complete = The trial is complete. { $kept }
session-ended = The session was ended
nothing-more = There is nothing more to do. { $kept }
comment-in-box = Your last comment is still in the box. Save it or delete it.
continue = Continue
finish = Finish
unrecorded = This step is not recorded yet because the server cannot write to its disk. Tell the operator.
act-unanswered = The server does not answer. Try again in a moment.
tap-unanswered = The server did not answer. Tap again.
one-moment = One moment…
change-first = This is the first setting.
change-next = The setting has changed.
change-write = Look around as you would in surgery, and write what you notice.
change-say = Look around as you would in surgery, and say or write what you notice.

## What is saved, and what is not

saving = Saving…
comments-saved =
    { $count ->
        [one] 1 comment saved
       *[other] { $count } comments saved
    }
kept-refused =
    { $count ->
        [one] 1 comment or answer could not be saved. It is kept on this device. Tell the operator.
       *[other] { $count } comments or answers could not be saved. They are kept on this device. Tell the operator.
    }
still-saving = Please keep this page open. Some of what you said is still being saved.
all-saved = Everything you said is saved.
no-connection = No connection. This page keeps trying.
no-answer-yet = No answer yet. This page keeps trying.
held-comments =
    { $count ->
        [one] 1 comment
       *[other] { $count } comments
    }
held-recordings =
    { $count ->
        [one] 1 recording
       *[other] { $count } recordings
    }
held-here = Saved here: { $what }.
held-on-page = Kept on this page only, so do not close it: { $what }.
sent-later = Sent when the network is back.
over-held =
    { $count ->
        [one] 1 comment or answer is still on this tablet. Sending…
       *[other] { $count } comments and answers are still on this tablet. Sending…
    }
over-saved = Everything on this tablet has been saved.
storage-advice = This browser keeps nothing on the device: its storage is full or switched off, as in a private window. What you say waits on this page until it is saved, so do not close or reload the page.
screen-advice = This browser does not keep the screen on. Set the tablet so that its screen stays on.

## Comments

write-what-you-see = Write what you see
write-comment = Write a comment
comments-later = Comments are kept once a trial begins
about-setting = This comment is about setting { $setting }.
continue-draft = Continue “{ $start }”
begun-elsewhere = Begun in another tab: { $whole }
undo-what = Undo: { $what }
the-mark = the mark
comment-not-saved = The comment was not saved and is back in the box: { $reason }
mark-not-saved = The mark was not saved: { $reason }
comment-not-undone = The comment was not taken back: { $reason }
quick-not-saved = “{ $text }” was not saved: { $reason }

## Voice

hold-to-talk = Hold to talk
talk-wait = Wait…
talk-ends = Ends in { $seconds } s
talk-recording = Recording { $time }
recording = Recording
saved-as-you-speak = Saved as you speak.
saving-recording = Saving the recording…
recording-saved = Recording saved
recordings-refused =
    { $count ->
        [one] 1 recording was not saved and stays on this device. Tell the operator. { $reason }
       *[other] { $count } recordings were not saved and stay on this device. Tell the operator. { $reason }
    }
talk-lost = The microphone was taken away. What you said until then is kept.
talk-limit = The recording ended after two minutes. What you said is kept. Let go, then press again to continue.
talk-left = The recording ended because something else came in front of this page. What you said until then is kept. Press again to continue.
talk-nothing = Nothing was recorded. Hold until it says “Recording”, then speak.
try-microphone = Try the microphone
microphone-ready = The microphone is ready.
microphone-failed = The microphone could not be opened.
microphone-failed-type = The microphone could not be opened. Type your comment.
microphone-unencrypted = Voice needs an encrypted connection (https), which this page does not have. Type your comments.
microphone-unable = This browser cannot record voice. Type your comments.
microphone-reload = Load this page again to use the microphone. Until then, type your comments.
microphone-no-start = This browser could not begin to record. Type your comment.
microphone-blocked = The microphone is blocked for this page. Allow it in the browser’s settings, or type your comment.
microphone-none = This device has no microphone. Connect one, or type your comment.
microphone-busy = Another program uses the microphone. Close it, or type your comment.

## Questions

optional = (optional)
not-answered = Not answered yet
answered-of = { $given } of { $total } answered
partly-answered = { $open } · { $state }
answer-saved = Saved
answer-waiting = Saved here. It is sent when the connection is back.
writing = Writing…
earlier-stays = The earlier answer stays until you write another.
questions-open =
    { $count ->
        [one] One question is still open.
       *[other] { $count } questions are still open.
    }
answers-kept = { $trouble } Your answers are saved here.
answer-refused = One answer was not saved. The reason is shown above.
scale-point = { $point } of { $points }
scale-end = { $point } of { $points }, { $meaning }
line-value = { $value } of 100, from { $low } to { $high }
gradation = { $value } of 100
line-less = Less: { $low }
line-more = More: { $high }
not-marked = Not marked yet
no = No
not-sure = Not sure
yes = Yes
recognised-this = By what did you recognise this setting?
recognised-which = Which settings did you recognise, and by what? Give their numbers.
pair-choose = In each pair, tap the one that contributed more to the workload.
pair-label = { $first } or { $second }
best = Best
worst = Worst
setting-number = Setting { $setting }
give-places = Give each setting a place. Settings may share a place.
order-right = This order is right
order-kept = Kept on this device until you tap “{ order-right }”
order-help = Drag a setting by its handle, or use the arrows; ⤒ puts it first. The order below is drawn by lot.
order-moved = Setting { $setting } is now in place { $place } of { $places }
move-up = Move setting { $setting } up
move-down = Move setting { $setting } down
move-first = Put setting { $setting } first
place =
    { $ending ->
        [one] { $place }st
        [two] { $place }nd
        [few] { $place }rd
       *[other] { $place }th
    }
place-best = { $place }, best

## Answers of the server

link-refused = This link is no longer valid here. Open it again, or ask for a new one.
text-too-long = This text is too long. Send it in shorter parts.
other-answered = Something else answered in place of the server. Check which network this device is on.
server-error = The server answered with an error ({ $status }).
server-silent = No connection to the server. Try again in a moment.
refused-no-session = there is no such session; reload the page
refused-no-setting = this session has no such setting; reload the page
refused-no-question = this session does not ask this question about this setting; reload the page
refused-paused = the session is paused
refused-aborted = the session was aborted
refused-ended = the session has ended
refused-not-started = the session has not started
refused-not-reached = this setting has not been reached
refused-not-begun = this setting has not begun
refused-not-asked = the questions on this setting have not been asked
refused-closing-not-asked = the closing questions have not been asked
refused-question-not-asked = this question has not been asked yet
refused-still-open = still to be answered: { $question }
refused-centre = the protocol keeps the focus on the centre of the view
refused-no-hold = the protocol does not let anybody hold the focus
refused-point-not-looking = the focus is pointed only while a setting is inspected
refused-hold-not-looking = the focus is held only while a setting is inspected
refused-outside = the place lies outside the picture
refused-under-way = a session is under way; load the page again
refused-empty = the comment is empty
refused-no-voice = this trial does not record voice; type the comment
refused-too-long = the text is { $length } bytes long; the limit is { $limit }, so please split it

## Pages that say why something was not done

error-nothing-here = Nothing here
error-not-open = Not open to this browser
error-not-now = Not possible now
error-server-failed = The server failed
error-did-not-work = That did not work
error-start-page = Go to the start page
error-sign-in = Sign in
error-needs-surgeon = This page is for the surgeon. Open it with the surgeon's link: the operator has it.
error-no-role = This browser has not been let in yet. Open it with the link of your role: the server prints all three when it starts; a surgeon gets the link from the operator.
error-wrong-key = This link is not valid, or no longer valid. A surgeon gets the link from the operator; the server printed all of them when it last started.
error-session-over = This link was for one session, which has ended. This tablet can still send what it holds from that session. For the next session the operator shows a new code.
error-needs-session-link = The session under way has its own link. Scan the code on the operator's page.
error-cross-site = This request came from another site and was not done. Go back to the page and try again from there.
error-busy = Too many pages are open at once. Close some of them, then try again.
error-storage = Could not be saved: { $reason }
error-internal = The server failed to handle this request. What was saved before is safe. The server's log says more.
error-misspelled = This address is incomplete or misspelled. Open the link once more as you were given it, or go to the start page.
error-no-address = There is nothing at this address.
error-timeout = The server took too long; try again.
session-over-title = Session over

## The page that tries a tablet

tablet-intro = Once for each tablet, before its first trial: tap the button, and allow the microphone if the tablet asks.
tablet-go = Try everything
tablet-too-old = Nothing happens at a tap? Then this browser is too old: iPadOS 16.4, Chrome 108, Firefox 121 or newer.
tablet-guided-access = On an iPad, Guided Access keeps the tablet on this page: Settings, Accessibility, Guided Access. Then press the top button three times on the surgeon’s page.
tablet-open-page = Open the surgeon’s page
tablet-trying = Trying…
tablet-works = { $part }: works
tablet-fails = { $part }: { $advice }
tablet-told = The operator’s page shows it, too, in the card “Ready for a trial?”.
tablet-not-told = The server did not answer, so the operator does not know it yet. Try again.
tablet-encrypted = Encrypted connection
    .advice = open the page by https, or voice and opening without a network do not work
tablet-storage = Storage for comments
    .advice = leave private browsing, or make room on the tablet: a reload would lose comments
tablet-disk = Storage for voice
    .advice = leave private browsing, or make room on the tablet: recordings would be lost at a reload
tablet-stream = Live connection
    .advice = the network does not let WebSocket connections through; use another one
tablet-picture = Drawing pictures
    .advice = this browser is too old: iPadOS 16.4, Chrome 108, Firefox 121 or newer
tablet-microphone = Microphone
    .advice = allow it for this page in the browser’s settings; without it comments can be typed
tablet-screen-on = Keeping the screen on
    .advice = set the tablet so that its screen stays on
tablet-all-works = Everything works on this tablet.
tablet-unfit = This tablet is not fit for a trial as it is.
tablet-mostly = A trial can run on this tablet. Look at what does not work.
