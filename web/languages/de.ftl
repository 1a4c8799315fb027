# Was Chirurginnen und Chirurgen lesen, auf Deutsch (Sie). Das Format ist Fluent: https://projectfluent.org/fluent/guide

## The surgeon's page: its fixed words

live-view = Livebild
practice = Übung
reduced-picture = Verkleinertes Bild
pause = Pause
display = Anzeige
show-patch = Scharf gehaltene Stelle anzeigen
show-edge = Rand des Bildfelds anzeigen
show-sharp = Scharfe Bereiche hervorheben
brightness = Helligkeit um das Bild
try-tablet = Dieses Tablet prüfen
not-a-device = Für die Forschung. Kein Medizinprodukt.
page-starting = Wird gestartet… Bleibt diese Zeile stehen, laden Sie die Seite neu. Bleibt sie auch dann, ist dieser Browser zu alt: iPadOS 16.4, Chrome 108, Firefox 121 oder neuer.
needs-javascript = Diese Seite braucht JavaScript. Erlauben Sie es für diese Adresse und laden Sie die Seite neu.
estimated-colours = Geschätzte Farben: Der Sensor sieht kein Rot.
focus-buttons =
    .aria-label = Fokus
centre = Mitte
comments-area =
    .aria-label = Kommentare
quick-area =
    .aria-label = Kurzkommentare
comment-box =
    .aria-label = Kommentar
    .placeholder = Schreiben Sie, was Sie sehen
save-comment = Speichern
mark-moment = Moment markieren
done-with-setting = Einstellung beenden
tap-again = Noch einmal tippen
undo = Rückgängig
tap-to-continue = Zum Fortfahren tippen

## The picture and the focus

view-help = Livebild. Plus und Minus zoomen, Null zeigt alles.
view-help-pointing = { view-help } Wo es erlaubt ist, richtet Umschalt mit einer Pfeiltaste den Fokus, und C bringt ihn zurück zur Mitte.
show-all = { NUMBER($zoom, minimumFractionDigits: 1, maximumFractionDigits: 1) }× · Alles zeigen
picture-not-live = Das Bild ist nicht live
picture-live-again = Das Bild ist wieder live
picture-first = Warten auf das erste Bild
picture-old = Nicht live: Das Bild ist über eine halbe Sekunde alt
picture-old-seconds = Nicht live: Das Bild ist { $seconds } Sekunden alt
picture-old-minutes = Nicht live: Das Bild ist { $minutes } Minuten alt
picture-connecting = { $state } · wird verbunden
hold-focus = Fokus halten
focus-held = Fokus gehalten
not-pointed-server = Der Server antwortet nicht, deshalb wurde der Fokus nicht verschoben.
not-pointed-live = Das Bild ist nicht live, deshalb wurde der Fokus nicht verschoben.
simulated-camera = Simulierte Kamera
simulated-lens = Simulierte Linse
simulated-both = Simulierte Kamera und Linse
camera-failed = Die Kamera liefert keine Bilder.
lens-failed = Der Fokus wird im Moment gehalten.

## What to do now

now-scan-code = Scannen Sie den Code der Versuchsleitung, um die nächste Sitzung zu öffnen.
now-connecting = Verbindung zum Server wird hergestellt…
now-nothing = Noch nichts zu tun: Warten Sie, bis die Versuchsleitung einen Versuch beginnt.
now-press-continue = Tippen Sie auf „Weiter“, wenn Sie bereit sind.
now-wait-paused = Warten Sie auf die Versuchsleitung. Sie können weiter kommentieren.
now-wait-start = Warten Sie, bis die Versuchsleitung den Versuch beginnt.
now-tap-begin = Tippen Sie, um Einstellung { $setting } zu beginnen.
now-ends-soon = Diese Einstellung endet gleich. Was Sie schreiben, bleibt erhalten.
now-look-write = Schreiben Sie, was Ihnen auffällt. Beenden Sie dann die Einstellung.
now-look-say = Sagen oder schreiben Sie, was Ihnen auffällt. Beenden Sie dann die Einstellung.
now-answer = Beantworten Sie die Fragen und tippen Sie dann auf „Weiter“.
now-answer-last = Beantworten Sie die letzten Fragen und tippen Sie dann auf „Fertig“.
now-keep-open = Lassen Sie diese Seite offen, bis alles gespeichert ist.
now-comment-left = Speichern oder löschen Sie den Kommentar im Feld.
now-practice-over = Die Übung ist zu Ende. Behalten Sie das Tablet: Als Nächstes kommt der Versuch.
now-done = Sie sind fertig. Geben Sie das Tablet zurück.
now-unreachable = Der Server ist nicht erreichbar.
now-silent-since = Kein Server seit { $time } Uhr.
now-certificate-over = Sein Zertifikat ist abgelaufen: Informieren Sie die Versuchsleitung.
now-keeps-trying = Diese Seite versucht es weiter.
now-comment-on = Kommentare bleiben hier und werden später gesendet.

## The session

setting-of = Einstellung { $setting } von { $settings }
time-left = noch { $time }
paused = Pausiert
paused-by-you = Sie haben die Sitzung pausiert. Sie können weiter kommentieren.
paused-by-restart = Der Server wurde neu gestartet. { $saved } Machen Sie dort weiter, wo Sie waren.
paused-by-absence = Dieses Tablet war nicht verbunden, deshalb wurde die Sitzung pausiert. { $saved } Machen Sie dort weiter, wo Sie waren.
paused-by-picture = Das Bild war für diesen Versuch zu klein, deshalb wurde er pausiert. Machen Sie weiter, sobald es besser ist.
paused-by-operator = Die Versuchsleitung hat die Sitzung pausiert. Sie können weiter kommentieren.
ready =
    { $settings ->
        [one] Sie werden eine Einstellung ansehen. Die Versuchsleitung beginnt den Versuch.
       *[other] Sie werden { $settings } Einstellungen nacheinander ansehen. Die Versuchsleitung beginnt den Versuch.
    }
no-trial = Es läuft kein Versuch. Sie können sich umsehen.
not-open-here = Für dieses Tablet nicht freigegeben
few-questions = Einstellung { $setting }: einige Fragen
final-questions = Letzte Fragen
practice-over = Die Übung ist zu Ende
practice-over-more = Das war eine Übung; sie zählt nicht. { $kept }
thank-you = Vielen Dank
trial-complete = Der Versuch ist abgeschlossen. { $kept }
session-ended = Die Sitzung wurde beendet
nothing-more = Es gibt nichts mehr zu tun. { $kept }
comment-in-box = Ihr letzter Kommentar steht noch im Feld. Speichern oder löschen Sie ihn.
continue = Weiter
finish = Fertig
unrecorded = Dieser Schritt ist noch nicht aufgezeichnet, weil der Server nicht auf seine Festplatte schreiben kann. Informieren Sie die Versuchsleitung.
act-unanswered = Der Server antwortet nicht. Versuchen Sie es gleich noch einmal.
tap-unanswered = Der Server hat nicht geantwortet. Tippen Sie noch einmal.
one-moment = Einen Moment…
change-first = Das ist die erste Einstellung.
change-next = Die Einstellung hat gewechselt.
change-write = Sehen Sie sich um wie bei einer Operation und schreiben Sie, was Ihnen auffällt.
change-say = Sehen Sie sich um wie bei einer Operation und sagen oder schreiben Sie, was Ihnen auffällt.

## What is saved, and what is not

saving = Wird gespeichert…
comments-saved =
    { $count ->
        [one] 1 Kommentar gespeichert
       *[other] { $count } Kommentare gespeichert
    }
kept-refused =
    { $count ->
        [one] 1 Kommentar oder Antwort konnte nicht gespeichert werden und bleibt auf diesem Gerät. Informieren Sie die Versuchsleitung.
       *[other] { $count } Kommentare oder Antworten konnten nicht gespeichert werden und bleiben auf diesem Gerät. Informieren Sie die Versuchsleitung.
    }
still-saving = Bitte lassen Sie diese Seite offen. Einiges, was Sie gesagt haben, wird noch gespeichert.
all-saved = Alles, was Sie gesagt haben, ist gespeichert.
no-connection = Keine Verbindung. Diese Seite versucht es weiter.
no-answer-yet = Noch keine Antwort. Diese Seite versucht es weiter.
held-comments =
    { $count ->
        [one] 1 Kommentar
       *[other] { $count } Kommentare
    }
held-recordings =
    { $count ->
        [one] 1 Aufnahme
       *[other] { $count } Aufnahmen
    }
held-here = Hier gespeichert: { $what }.
held-on-page = Nur auf dieser Seite gespeichert, schließen Sie sie nicht: { $what }.
sent-later = Wird gesendet, sobald das Netz wieder da ist.
over-held =
    { $count ->
        [one] 1 Kommentar oder Antwort ist noch auf diesem Tablet. Wird gesendet…
       *[other] { $count } Kommentare und Antworten sind noch auf diesem Tablet. Wird gesendet…
    }
over-saved = Alles auf diesem Tablet ist gespeichert.
storage-advice = Dieser Browser speichert nichts auf dem Gerät: Sein Speicher ist voll oder ausgeschaltet, wie in einem privaten Fenster. Was Sie sagen, wartet auf dieser Seite, bis es gespeichert ist. Schließen Sie die Seite nicht und laden Sie sie nicht neu.
screen-advice = Dieser Browser hält den Bildschirm nicht eingeschaltet. Stellen Sie das Tablet so ein, dass der Bildschirm eingeschaltet bleibt.

## Comments

write-what-you-see = Schreiben Sie, was Sie sehen
write-comment = Schreiben Sie einen Kommentar
comments-later = Kommentare werden gespeichert, sobald ein Versuch beginnt
about-setting = Dieser Kommentar betrifft Einstellung { $setting }.
continue-draft = „{ $start }“ fortsetzen
begun-elsewhere = In einem anderen Tab begonnen: { $whole }
undo-what = Rückgängig: { $what }
the-mark = die Markierung
comment-not-saved = Der Kommentar wurde nicht gespeichert und steht wieder im Feld: { $reason }
mark-not-saved = Die Markierung wurde nicht gespeichert: { $reason }
comment-not-undone = Der Kommentar wurde nicht zurückgenommen: { $reason }
quick-not-saved = „{ $text }“ wurde nicht gespeichert: { $reason }

## Voice

hold-to-talk = Zum Sprechen halten
talk-wait = Warten…
talk-ends = Endet in { $seconds } s
talk-recording = Aufnahme { $time }
recording = Aufnahme läuft
saved-as-you-speak = Wird beim Sprechen gespeichert.
saving-recording = Aufnahme wird gespeichert…
recording-saved = Aufnahme gespeichert
recordings-refused =
    { $count ->
        [one] 1 Aufnahme wurde nicht gespeichert und bleibt auf diesem Gerät. Informieren Sie die Versuchsleitung. { $reason }
       *[other] { $count } Aufnahmen wurden nicht gespeichert und bleiben auf diesem Gerät. Informieren Sie die Versuchsleitung. { $reason }
    }
talk-lost = Das Mikrofon steht nicht mehr zur Verfügung. Was Sie bis dahin gesagt haben, bleibt erhalten.
talk-limit = Die Aufnahme endete nach zwei Minuten. Was Sie gesagt haben, bleibt erhalten. Lassen Sie los und drücken Sie erneut, um fortzufahren.
talk-left = Die Aufnahme endete, weil etwas anderes vor diese Seite kam. Was Sie bis dahin gesagt haben, bleibt erhalten. Drücken Sie erneut, um fortzufahren.
talk-nothing = Es wurde nichts aufgenommen. Halten Sie die Taste gedrückt, bis „Aufnahme“ erscheint, und sprechen Sie dann.
try-microphone = Mikrofon prüfen
microphone-ready = Das Mikrofon ist bereit.
microphone-failed = Das Mikrofon konnte nicht geöffnet werden.
microphone-failed-type = Das Mikrofon konnte nicht geöffnet werden. Tippen Sie Ihren Kommentar.
microphone-unencrypted = Sprache braucht eine verschlüsselte Verbindung (https), die diese Seite nicht hat. Tippen Sie Ihre Kommentare.
microphone-unable = Dieser Browser kann keine Sprache aufnehmen. Tippen Sie Ihre Kommentare.
microphone-reload = Laden Sie diese Seite neu, um das Mikrofon zu benutzen. Tippen Sie bis dahin Ihre Kommentare.
microphone-no-start = Dieser Browser konnte die Aufnahme nicht beginnen. Tippen Sie Ihren Kommentar.
microphone-blocked = Das Mikrofon ist für diese Seite gesperrt. Erlauben Sie es in den Einstellungen des Browsers, oder tippen Sie Ihren Kommentar.
microphone-none = Dieses Gerät hat kein Mikrofon. Schließen Sie eines an, oder tippen Sie Ihren Kommentar.
microphone-busy = Ein anderes Programm benutzt das Mikrofon. Schließen Sie es, oder tippen Sie Ihren Kommentar.

## Questions

optional = (freiwillig)
not-answered = Noch nicht beantwortet
answered-of = { $given } von { $total } beantwortet
partly-answered = { $open } · { $state }
answer-saved = Gespeichert
answer-waiting = Hier gespeichert. Wird gesendet, sobald die Verbindung wieder da ist.
writing = Sie schreiben…
earlier-stays = Die frühere Antwort gilt, bis Sie eine andere schreiben.
questions-open =
    { $count ->
        [one] Eine Frage ist noch offen.
       *[other] { $count } Fragen sind noch offen.
    }
answers-kept = { $trouble } Ihre Antworten sind hier gespeichert.
answer-refused = Eine Antwort wurde nicht gespeichert. Der Grund steht oben.
scale-point = { $point } von { $points }
scale-end = { $point } von { $points }, { $meaning }
line-value = { $value } von 100, von { $low } bis { $high }
gradation = { $value } von 100
line-less = Weniger: { $low }
line-more = Mehr: { $high }
not-marked = Noch nicht markiert
no = Nein
not-sure = Unsicher
yes = Ja
recognised-this = Woran haben Sie diese Einstellung erkannt?
recognised-which = Welche Einstellungen haben Sie erkannt, und woran? Nennen Sie ihre Nummern.
pair-choose = Tippen Sie in jedem Paar auf das, was mehr zur Belastung beigetragen hat.
pair-label = { $first } oder { $second }
best = Beste
worst = Schlechteste
setting-number = Einstellung { $setting }
give-places = Geben Sie jeder Einstellung einen Platz. Einstellungen dürfen sich einen Platz teilen.
order-right = Diese Reihenfolge stimmt
order-kept = Auf diesem Gerät, bis Sie auf „{ order-right }“ tippen
order-help = Ziehen Sie eine Einstellung am Griff, oder benutzen Sie die Pfeile; ⤒ setzt sie an die erste Stelle. Die Reihenfolge unten ist ausgelost.
order-moved = Einstellung { $setting } ist jetzt auf Platz { $place } von { $places }
move-up = Einstellung { $setting } nach oben
move-down = Einstellung { $setting } nach unten
move-first = Einstellung { $setting } an die erste Stelle
place = { $place }.
place-best = { $place } (beste)

## Answers of the server

link-refused = Dieser Link gilt hier nicht mehr. Öffnen Sie ihn noch einmal, oder bitten Sie um einen neuen.
text-too-long = Dieser Text ist zu lang. Senden Sie ihn in kürzeren Teilen.
other-answered = Statt des Servers hat etwas anderes geantwortet. Prüfen Sie, in welchem Netz dieses Gerät ist.
server-error = Der Server hat mit einem Fehler geantwortet ({ $status }).
server-silent = Keine Verbindung zum Server. Versuchen Sie es gleich noch einmal.
refused-no-session = diese Sitzung gibt es nicht; laden Sie die Seite neu
refused-no-setting = diese Sitzung hat keine solche Einstellung; laden Sie die Seite neu
refused-no-question = diese Sitzung stellt diese Frage zu dieser Einstellung nicht; laden Sie die Seite neu
refused-paused = die Sitzung ist pausiert
refused-aborted = die Sitzung wurde abgebrochen
refused-ended = die Sitzung ist zu Ende
refused-not-started = die Sitzung hat nicht begonnen
refused-not-reached = diese Einstellung ist noch nicht erreicht
refused-not-begun = diese Einstellung hat noch nicht begonnen
refused-not-asked = die Fragen zu dieser Einstellung wurden noch nicht gestellt
refused-closing-not-asked = die letzten Fragen wurden noch nicht gestellt
refused-question-not-asked = diese Frage wurde noch nicht gestellt
refused-still-open = noch zu beantworten: { $question }
refused-centre = das Protokoll hält den Fokus in der Mitte des Bildes
refused-no-hold = das Protokoll erlaubt nicht, den Fokus zu halten
refused-point-not-looking = der Fokus wird nur verschoben, während eine Einstellung angesehen wird
refused-hold-not-looking = der Fokus wird nur gehalten, während eine Einstellung angesehen wird
refused-outside = die Stelle liegt außerhalb des Bildes
refused-under-way = eine Sitzung läuft; laden Sie die Seite neu
refused-empty = der Kommentar ist leer
refused-no-voice = dieser Versuch nimmt keine Sprache auf; tippen Sie den Kommentar
refused-too-long = der Text ist { $length } Byte lang; erlaubt sind { $limit }, teilen Sie ihn bitte

## Pages that say why something was not done

error-nothing-here = Hier ist nichts
error-not-open = Für diesen Browser nicht freigegeben
error-not-now = Jetzt nicht möglich
error-server-failed = Fehler des Servers
error-did-not-work = Das hat nicht funktioniert
error-start-page = Zur Startseite
error-sign-in = Anmelden
error-needs-surgeon = Diese Seite ist für die Chirurgin oder den Chirurgen. Öffnen Sie sie mit dem passenden Link: Die Versuchsleitung hat ihn.
error-no-role = Dieser Browser hat noch keinen Zugang. Öffnen Sie ihn mit dem Link Ihrer Rolle: Der Server gibt beim Start alle drei aus; für die Chirurgie hat ihn die Versuchsleitung.
error-wrong-key = Dieser Link gilt nicht oder nicht mehr. Für die Chirurgie hat die Versuchsleitung den Link; der Server hat beim letzten Start alle ausgegeben.
error-session-over = Dieser Link galt für eine Sitzung, die zu Ende ist. Dieses Tablet kann noch senden, was es aus dieser Sitzung hat. Für die nächste Sitzung zeigt die Versuchsleitung einen neuen Code.
error-needs-session-link = Die laufende Sitzung hat einen eigenen Link. Scannen Sie den Code auf der Seite der Versuchsleitung.
error-cross-site = Diese Anfrage kam von einer anderen Website und wurde nicht ausgeführt. Gehen Sie zurück zur Seite und versuchen Sie es von dort.
error-busy = Zu viele Seiten sind gleichzeitig offen. Schließen Sie einige und versuchen Sie es noch einmal.
error-storage = Konnte nicht gespeichert werden: { $reason }
error-internal = Der Server konnte diese Anfrage nicht bearbeiten. Was vorher gespeichert wurde, ist sicher. Das Protokoll des Servers sagt mehr.
error-misspelled = Diese Adresse ist unvollständig oder falsch geschrieben. Öffnen Sie den Link noch einmal so, wie Sie ihn bekommen haben, oder gehen Sie zur Startseite.
error-no-address = Unter dieser Adresse gibt es nichts.
error-timeout = Der Server hat zu lange gebraucht; versuchen Sie es noch einmal.
session-over-title = Sitzung beendet

## The page that tries a tablet

tablet-intro = Einmal für jedes Tablet, vor dem ersten Versuch: Tippen Sie auf die Schaltfläche und erlauben Sie das Mikrofon, falls das Tablet fragt.
tablet-go = Alles prüfen
tablet-too-old = Beim Tippen geschieht nichts? Dann ist dieser Browser zu alt: iPadOS 16.4, Chrome 108, Firefox 121 oder neuer.
tablet-guided-access = Auf einem iPad hält „Geführter Zugriff“ das Tablet auf dieser Seite: Einstellungen, Bedienungshilfen, Geführter Zugriff. Drücken Sie dann auf der Seite der Chirurgie dreimal die obere Taste.
tablet-open-page = Seite der Chirurgie öffnen
tablet-trying = Wird geprüft…
tablet-works = { $part }: funktioniert
tablet-fails = { $part }: { $advice }
tablet-told = Die Seite der Versuchsleitung zeigt es auch, in der Karte „Ready for a trial?“.
tablet-not-told = Der Server hat nicht geantwortet, deshalb weiß es die Versuchsleitung noch nicht. Versuchen Sie es noch einmal.
tablet-encrypted = Verschlüsselte Verbindung
    .advice = öffnen Sie die Seite mit https, sonst gehen Sprache und das Öffnen ohne Netz nicht
tablet-storage = Speicher für Kommentare
    .advice = verlassen Sie den privaten Modus, oder schaffen Sie Platz auf dem Tablet; sonst gehen beim Neuladen Kommentare verloren
tablet-disk = Speicher für Sprache
    .advice = verlassen Sie den privaten Modus, oder schaffen Sie Platz auf dem Tablet; sonst gehen beim Neuladen Aufnahmen verloren
tablet-stream = Live-Verbindung
    .advice = das Netz lässt WebSocket-Verbindungen nicht durch; benutzen Sie ein anderes
tablet-picture = Bilder darstellen
    .advice = dieser Browser ist zu alt: iPadOS 16.4, Chrome 108, Firefox 121 oder neuer
tablet-microphone = Mikrofon
    .advice = erlauben Sie es für diese Seite in den Einstellungen des Browsers; ohne es können Kommentare getippt werden
tablet-screen-on = Bildschirm eingeschaltet lassen
    .advice = stellen Sie das Tablet so ein, dass der Bildschirm eingeschaltet bleibt
tablet-all-works = Auf diesem Tablet funktioniert alles.
tablet-unfit = In diesem Zustand eignet sich dieses Tablet nicht für einen Versuch.
tablet-mostly = Auf diesem Tablet kann ein Versuch laufen. Sehen Sie nach, was nicht funktioniert.
