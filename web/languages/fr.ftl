# Ce que lisent les chirurgiens, en français (vous). Le format est Fluent : https://projectfluent.org/fluent/guide

## The surgeon's page: its fixed words

live-view = Image en direct
practice = Entraînement
reduced-picture = Image réduite
pause = Pause
display = Affichage
show-patch = Montrer la zone maintenue nette
show-edge = Montrer le bord du champ
show-sharp = Souligner ce qui est net
brightness = Luminosité autour de l’image
try-tablet = Tester cette tablette
not-a-device = Pour la recherche. N’est pas un dispositif médical.
page-starting = Démarrage… Si cette ligne reste, rechargez la page. Si elle reste encore, ce navigateur est trop ancien : iPadOS 16.4, Chrome 108, Firefox 121 ou plus récent.
needs-javascript = Cette page a besoin de JavaScript. Autorisez-le pour cette adresse, puis rechargez la page.
estimated-colours = Couleurs estimées : le capteur ignore le rouge.
focus-buttons =
    .aria-label = Mise au point
centre = Centre
comments-area =
    .aria-label = Commentaires
quick-area =
    .aria-label = Commentaires rapides
comment-box =
    .aria-label = Commentaire
    .placeholder = Écrivez ce que vous voyez
save-comment = Enregistrer
mark-moment = Marquer cet instant
done-with-setting = Terminer ce réglage
tap-again = Touchez encore
undo = Annuler
tap-to-continue = Touchez pour continuer

## The picture and the focus

view-help = Image en direct. Plus et moins règlent le zoom, zéro montre tout.
view-help-pointing = { view-help } Si c’est permis, Maj et une flèche déplacent la mise au point, et C la ramène au centre.
show-all = { NUMBER($zoom, minimumFractionDigits: 1, maximumFractionDigits: 1) }× · Tout montrer
picture-not-live = L’image n’est pas en direct
picture-live-again = L’image est de nouveau en direct
picture-first = En attente de la première image
picture-old = Pas en direct : l’image a plus d’une demi-seconde
picture-old-seconds = Pas en direct : l’image a { $seconds } secondes
picture-old-minutes = Pas en direct : l’image a { $minutes } minutes
picture-connecting = { $state } · connexion en cours
hold-focus = Figer la netteté
focus-held = Netteté figée
not-pointed-server = Le serveur ne répond pas : la mise au point n’a pas été déplacée.
not-pointed-live = L’image n’est pas en direct : la mise au point n’a pas été déplacée.
simulated-camera = Caméra simulée
simulated-lens = Lentille simulée
simulated-both = Caméra et lentille simulées
camera-failed = La caméra ne fournit pas d’images.
lens-failed = La mise au point est figée pour le moment.

## What to do now

now-scan-code = Scannez le code de l’équipe de l’essai pour ouvrir la séance suivante.
now-connecting = Connexion au serveur…
now-nothing = Rien à faire pour l’instant : attendez que l’équipe lance un essai.
now-press-continue = Appuyez sur « Continuer » quand vous voulez reprendre.
now-wait-paused = Attendez l’équipe de l’essai. Vous pouvez encore commenter.
now-wait-start = Attendez que l’équipe lance l’essai.
now-tap-begin = Touchez pour commencer le réglage { $setting }.
now-ends-soon = Ce réglage se termine dans un instant. Ce que vous écrivez est conservé.
now-look-write = Regardez et écrivez ce que vous remarquez. Puis terminez le réglage.
now-look-say = Regardez et dites ou écrivez ce que vous remarquez. Puis terminez le réglage.
now-answer = Répondez aux questions, puis appuyez sur « Continuer ».
now-answer-last = Répondez aux dernières questions, puis appuyez sur « Terminer ».
now-keep-open = Gardez cette page ouverte jusqu’à ce que tout soit enregistré.
now-comment-left = Enregistrez ou effacez le commentaire dans le champ.
now-practice-over = L’entraînement est terminé. Gardez la tablette : l’essai vient ensuite.
now-done = Vous avez terminé. Rendez la tablette.
now-unreachable = Le serveur est injoignable.
now-silent-since = Serveur absent depuis { $time }.
now-certificate-over = Son certificat a expiré : prévenez l’équipe de l’essai.
now-keeps-trying = Cette page continue d’essayer.
now-comment-on = Les commentaires sont gardés ici et envoyés plus tard.

## The session

setting-of = Réglage { $setting } sur { $settings }
time-left = reste { $time }
paused = En pause
paused-by-you = Vous avez mis la séance en pause. Vous pouvez encore commenter.
paused-by-restart = Le serveur a redémarré. { $saved } Reprenez où vous en étiez.
paused-by-absence = Cette tablette était absente, la séance a donc été mise en pause. { $saved } Reprenez où vous en étiez.
paused-by-picture = L’image était trop petite pour cet essai, il a donc été mis en pause. Continuez quand elle sera meilleure.
paused-by-operator = L’équipe a mis la séance en pause. Vous pouvez encore commenter.
ready =
    { $settings ->
        [one] Vous regarderez un réglage. L’équipe lancera l’essai.
       *[other] Vous regarderez { $settings } réglages, l’un après l’autre. L’équipe lancera l’essai.
    }
no-trial = Aucun essai n’est en cours. Vous pouvez regarder.
not-open-here = Non accessible depuis cette tablette
few-questions = Réglage { $setting } : quelques questions
final-questions = Dernières questions
practice-over = L’entraînement est terminé
practice-over-more = C’était un entraînement ; il ne compte pas. { $kept }
thank-you = Merci
trial-complete = L’essai est terminé. { $kept }
session-ended = La séance a été arrêtée
nothing-more = Il n’y a plus rien à faire. { $kept }
comment-in-box = Votre dernier commentaire est encore dans le champ. Enregistrez-le ou effacez-le.
continue = Continuer
finish = Terminer
unrecorded = Cette étape n’est pas encore enregistrée, car le serveur ne peut pas écrire sur son disque. Prévenez l’équipe de l’essai.
act-unanswered = Le serveur ne répond pas. Réessayez dans un instant.
tap-unanswered = Le serveur n’a pas répondu. Touchez encore.
one-moment = Un instant…
change-first = C’est le premier réglage.
change-next = Le réglage a changé.
change-write = Regardez comme en opération, et écrivez ce que vous remarquez.
change-say = Regardez comme en opération, et dites ou écrivez ce que vous remarquez.

## What is saved, and what is not

saving = Enregistrement…
comments-saved =
    { $count ->
        [one] { $count } commentaire enregistré
       *[other] { $count } commentaires enregistrés
    }
kept-refused =
    { $count ->
        [one] { $count } commentaire ou réponse n’a pas pu être enregistré et reste sur cet appareil. Prévenez l’équipe de l’essai.
       *[other] { $count } commentaires ou réponses n’ont pas pu être enregistrés et restent sur cet appareil. Prévenez l’équipe de l’essai.
    }
still-saving = Gardez cette page ouverte. Une partie de ce que vous avez dit est en cours d’enregistrement.
all-saved = Tout ce que vous avez dit est enregistré.
no-connection = Pas de connexion. Cette page continue d’essayer.
no-answer-yet = Pas encore de réponse. Cette page continue d’essayer.
held-comments =
    { $count ->
        [one] { $count } commentaire
       *[other] { $count } commentaires
    }
held-recordings =
    { $count ->
        [one] { $count } enregistrement
       *[other] { $count } enregistrements
    }
held-here = Conservé ici : { $what }.
held-on-page = Conservé sur cette page seulement, ne la fermez pas : { $what }.
sent-later = Envoyé dès que le réseau revient.
over-held =
    { $count ->
        [one] { $count } commentaire ou réponse est encore sur cette tablette. Envoi…
       *[other] { $count } commentaires et réponses sont encore sur cette tablette. Envoi…
    }
over-saved = Tout ce qui était sur cette tablette est enregistré.
storage-advice = Ce navigateur ne conserve rien sur l’appareil : son stockage est plein ou désactivé, comme dans une fenêtre privée. Ce que vous dites attend sur cette page jusqu’à son enregistrement. Ne fermez pas et ne rechargez pas la page.
screen-advice = Ce navigateur ne garde pas l’écran allumé. Réglez la tablette pour que l’écran reste allumé.

## Comments

write-what-you-see = Écrivez ce que vous voyez
write-comment = Écrivez un commentaire
comments-later = Les commentaires sont conservés dès le début d’un essai
about-setting = Ce commentaire concerne le réglage { $setting }.
continue-draft = Continuer « { $start } »
begun-elsewhere = Commencé dans un autre onglet : { $whole }
undo-what = Annuler : { $what }
the-mark = le repère
comment-not-saved = Le commentaire n’a pas été enregistré et se trouve à nouveau dans le champ : { $reason }
mark-not-saved = Le repère n’a pas été enregistré : { $reason }
comment-not-undone = Le commentaire n’a pas été retiré : { $reason }
quick-not-saved = « { $text } » n’a pas été enregistré : { $reason }

## Voice

hold-to-talk = Maintenir pour parler
talk-wait = Attendez…
talk-ends = Fin dans { $seconds } s
talk-recording = Enregistre { $time }
recording = Enregistrement en cours
saved-as-you-speak = Enregistré pendant que vous parlez.
saving-recording = Enregistrement du commentaire vocal…
recording-saved = Commentaire vocal enregistré
recordings-refused =
    { $count ->
        [one] { $count } commentaire vocal n’a pas été enregistré et reste sur cet appareil. Prévenez l’équipe de l’essai. { $reason }
       *[other] { $count } commentaires vocaux n’ont pas été enregistrés et restent sur cet appareil. Prévenez l’équipe de l’essai. { $reason }
    }
talk-lost = Le microphone a été retiré. Ce que vous avez dit jusque-là est conservé.
talk-limit = L’enregistrement s’est arrêté après deux minutes. Ce que vous avez dit est conservé. Relâchez, puis appuyez encore pour continuer.
talk-left = L’enregistrement s’est arrêté car autre chose est passé devant cette page. Ce que vous avez dit jusque-là est conservé. Appuyez encore pour continuer.
talk-nothing = Rien n’a été enregistré. Maintenez jusqu’à « Enregistre », puis parlez.
try-microphone = Tester le microphone
microphone-ready = Le microphone est prêt.
microphone-failed = Le microphone n’a pas pu être ouvert.
microphone-failed-type = Le microphone n’a pas pu être ouvert. Tapez votre commentaire.
microphone-unencrypted = La voix exige une connexion chiffrée (https), que cette page n’a pas. Tapez vos commentaires.
microphone-unable = Ce navigateur ne peut pas enregistrer la voix. Tapez vos commentaires.
microphone-reload = Rechargez cette page pour utiliser le microphone. D’ici là, tapez vos commentaires.
microphone-no-start = Ce navigateur n’a pas pu commencer l’enregistrement. Tapez votre commentaire.
microphone-blocked = Le microphone est bloqué pour cette page. Autorisez-le dans les réglages du navigateur, ou tapez votre commentaire.
microphone-none = Cet appareil n’a pas de microphone. Branchez-en un, ou tapez votre commentaire.
microphone-busy = Un autre programme utilise le microphone. Fermez-le, ou tapez votre commentaire.

## Questions

optional = (facultatif)
not-answered = Pas encore de réponse
answered-of = Réponses : { $given } sur { $total }
partly-answered = { $open } · { $state }
answer-saved = Enregistré
answer-waiting = Conservé ici. Ce sera envoyé dès que la connexion revient.
writing = Vous écrivez…
earlier-stays = La réponse précédente reste jusqu’à ce que vous en écriviez une autre.
questions-open =
    { $count ->
        [one] Une question reste ouverte.
       *[other] { $count } questions restent ouvertes.
    }
answers-kept = { $trouble } Vos réponses sont conservées ici.
answer-refused = Une réponse n’a pas été enregistrée. La raison est indiquée plus haut.
scale-point = { $point } sur { $points }
scale-end = { $point } sur { $points }, { $meaning }
line-value = { $value } sur 100, de { $low } à { $high }
gradation = { $value } sur 100
line-less = Moins : { $low }
line-more = Plus : { $high }
not-marked = Pas encore marqué
no = Non
not-sure = Je ne sais pas
yes = Oui
recognised-this = À quoi avez-vous reconnu ce réglage ?
recognised-which = Quels réglages avez-vous reconnus, et à quoi ? Donnez leurs numéros.
pair-choose = Dans chaque paire, touchez ce qui a le plus contribué à la charge.
pair-label = { $first } ou { $second }
best = Meilleur
worst = Pire
setting-number = Réglage { $setting }
give-places = Donnez une place à chaque réglage. Des réglages peuvent partager une place.
order-right = Cet ordre est bon
order-kept = Conservé sur cet appareil jusqu’à ce que vous touchiez « { order-right } »
order-help = Faites glisser un réglage par sa poignée, ou utilisez les flèches ; ⤒ le met en premier. L’ordre ci-dessous est tiré au sort.
order-moved = Le réglage { $setting } est maintenant à la place { $place } sur { $places }
move-up = Monter le réglage { $setting }
move-down = Descendre le réglage { $setting }
move-first = Mettre le réglage { $setting } en premier
place =
    { $ending ->
        [one] { $place }er
       *[other] { $place }e
    }
place-best = { $place }, le meilleur

## Answers of the server

link-refused = Ce lien n’est plus valable ici. Ouvrez-le de nouveau, ou demandez-en un autre.
text-too-long = Ce texte est trop long. Envoyez-le en parties plus courtes.
other-answered = Autre chose a répondu à la place du serveur. Vérifiez le réseau de cet appareil.
server-error = Le serveur a répondu par une erreur ({ $status }).
server-silent = Pas de connexion au serveur. Réessayez dans un instant.
refused-no-session = cette séance n’existe pas ; rechargez la page
refused-no-setting = cette séance n’a pas ce réglage ; rechargez la page
refused-no-question = cette séance ne pose pas cette question sur ce réglage ; rechargez la page
refused-paused = la séance est en pause
refused-aborted = la séance a été arrêtée
refused-ended = la séance est terminée
refused-not-started = la séance n’a pas commencé
refused-not-reached = ce réglage n’est pas encore atteint
refused-not-begun = ce réglage n’a pas encore commencé
refused-not-asked = les questions sur ce réglage n’ont pas encore été posées
refused-closing-not-asked = les dernières questions n’ont pas encore été posées
refused-question-not-asked = cette question n’a pas encore été posée
refused-still-open = il reste à répondre à : { $question }
refused-centre = le protocole garde la mise au point au centre de l’image
refused-no-hold = le protocole ne permet pas de figer la mise au point
refused-point-not-looking = la mise au point ne se déplace que pendant l’examen d’un réglage
refused-hold-not-looking = la mise au point ne se fige que pendant l’examen d’un réglage
refused-outside = cet endroit est hors de l’image
refused-under-way = une séance est en cours ; rechargez la page
refused-empty = le commentaire est vide
refused-no-voice = cet essai n’enregistre pas la voix ; tapez le commentaire
refused-too-long = le texte fait { $length } octets ; la limite est de { $limit }, veuillez le diviser

## Pages that say why something was not done

error-nothing-here = Rien ici
error-not-open = Non accessible depuis ce navigateur
error-not-now = Pas possible maintenant
error-server-failed = Erreur du serveur
error-did-not-work = Cela n’a pas fonctionné
error-start-page = Aller à la page d’accueil
error-sign-in = Se connecter
error-needs-surgeon = Cette page est pour le chirurgien. Ouvrez-la avec le lien du chirurgien : l’équipe de l’essai l’a.
error-no-role = Ce navigateur n’a pas encore d’accès. Ouvrez-le avec le lien de votre rôle : le serveur affiche les trois au démarrage ; un chirurgien le reçoit de l’équipe de l’essai.
error-wrong-key = Ce lien n’est pas valable, ou ne l’est plus. Un chirurgien reçoit le lien de l’équipe de l’essai ; le serveur les a tous affichés à son dernier démarrage.
error-session-over = Ce lien était pour une séance, qui est terminée. Cette tablette peut encore envoyer ce qu’elle garde de cette séance. Pour la séance suivante, l’équipe de l’essai montre un nouveau code.
error-needs-session-link = La séance en cours a son propre lien. Scannez le code sur la page de l’équipe de l’essai.
error-cross-site = Cette demande venait d’un autre site et n’a pas été exécutée. Revenez à la page et réessayez de là.
error-busy = Trop de pages sont ouvertes à la fois. Fermez-en quelques-unes, puis réessayez.
error-storage = N’a pas pu être enregistré : { $reason }
error-internal = Le serveur n’a pas pu traiter cette demande. Ce qui était enregistré est en sécurité. Le journal du serveur en dit plus.
error-misspelled = Cette adresse est incomplète ou mal écrite. Ouvrez encore une fois le lien tel que vous l’avez reçu, ou allez à la page d’accueil.
error-no-address = Il n’y a rien à cette adresse.
error-timeout = Le serveur a mis trop de temps ; réessayez.
session-over-title = Séance terminée

## The page that tries a tablet

tablet-intro = Une fois par tablette, avant le premier essai : touchez le bouton, et autorisez le microphone si la tablette le demande.
tablet-go = Tout tester
tablet-too-old = Rien ne se passe quand vous touchez ? Ce navigateur est alors trop ancien : iPadOS 16.4, Chrome 108, Firefox 121 ou plus récent.
tablet-guided-access = Sur un iPad, l’Accès guidé garde la tablette sur cette page : Réglages, Accessibilité, Accès guidé. Appuyez ensuite trois fois sur le bouton supérieur sur la page du chirurgien.
tablet-open-page = Ouvrir la page du chirurgien
tablet-trying = Test en cours…
tablet-works = { $part } : fonctionne
tablet-fails = { $part } : { $advice }
tablet-told = La page de l’équipe de l’essai le montre aussi, dans la carte « Ready for a trial? ».
tablet-not-told = Le serveur n’a pas répondu, l’équipe de l’essai ne le sait donc pas encore. Réessayez.
tablet-encrypted = Connexion chiffrée
    .advice = ouvrez la page en https, sinon la voix et l’ouverture sans réseau ne fonctionnent pas
tablet-storage = Stockage des commentaires
    .advice = quittez la navigation privée, ou libérez de la place : un rechargement perdrait des commentaires
tablet-disk = Stockage de la voix
    .advice = quittez la navigation privée, ou libérez de la place : un rechargement perdrait des enregistrements
tablet-stream = Connexion en direct
    .advice = le réseau bloque les connexions WebSocket ; utilisez-en un autre
tablet-picture = Affichage des images
    .advice = ce navigateur est trop ancien : iPadOS 16.4, Chrome 108, Firefox 121 ou plus récent
tablet-microphone = Microphone
    .advice = autorisez-le pour cette page dans les réglages du navigateur ; sans lui, on peut taper les commentaires
tablet-screen-on = Écran toujours allumé
    .advice = réglez la tablette pour que l’écran reste allumé
tablet-all-works = Tout fonctionne sur cette tablette.
tablet-unfit = En l’état, cette tablette ne convient pas à un essai.
tablet-mostly = Un essai peut se dérouler sur cette tablette. Regardez ce qui ne fonctionne pas.
