# Lo que leen los cirujanos, en español (usted). El formato es Fluent: https://projectfluent.org/fluent/guide

## The surgeon's page: its fixed words

live-view = Imagen en directo
practice = Práctica
reduced-picture = Imagen reducida
pause = Pausa
display = Visualización
show-patch = Mostrar la zona que se mantiene enfocada
show-edge = Mostrar el borde del campo
show-sharp = Resaltar lo que está nítido
brightness = Brillo alrededor de la imagen
try-tablet = Probar esta tableta
not-a-device = Para investigación. No es un producto sanitario.
page-starting = Iniciando… Si esta línea permanece, vuelva a cargar la página. Si aún permanece, este navegador es demasiado antiguo: iPadOS 16.4, Chrome 108, Firefox 121 o posterior.
needs-javascript = Esta página necesita JavaScript. Permítalo para esta dirección y vuelva a cargar la página.
estimated-colours = Colores estimados: el sensor no ve el rojo.
focus-buttons =
    .aria-label = Enfoque
centre = Centro
comments-area =
    .aria-label = Comentarios
quick-area =
    .aria-label = Comentarios rápidos
comment-box =
    .aria-label = Comentario
    .placeholder = Escriba lo que ve
save-comment = Guardar
mark-moment = Marcar este momento
done-with-setting = Terminar este ajuste
tap-again = Toque otra vez
undo = Deshacer
tap-to-continue = Toque para continuar

## The picture and the focus

view-help = Imagen en directo. Más y menos cambian el zoom, cero lo muestra todo.
view-help-pointing = { view-help } Donde esté permitido, Mayús con una flecha mueve el enfoque, y C lo devuelve al centro.
show-all = { NUMBER($zoom, minimumFractionDigits: 1, maximumFractionDigits: 1) }× · Mostrar todo
picture-not-live = La imagen no está en directo
picture-live-again = La imagen vuelve a estar en directo
picture-first = Esperando la primera imagen
picture-old = No está en directo: la imagen tiene más de medio segundo
picture-old-seconds = No está en directo: la imagen tiene { $seconds } segundos
picture-old-minutes = No está en directo: la imagen tiene { $minutes } minutos
picture-connecting = { $state } · conectando
hold-focus = Mantener enfoque
focus-held = Enfoque mantenido
not-pointed-server = El servidor no responde, por eso no se ha movido el enfoque.
not-pointed-live = La imagen no está en directo, por eso no se ha movido el enfoque.
simulated-camera = Cámara simulada
simulated-lens = Lente simulada
simulated-both = Cámara y lente simuladas
camera-failed = La cámara no entrega imágenes.
lens-failed = El enfoque se mantiene fijo por el momento.

## What to do now

now-scan-code = Escanee el código del equipo del ensayo para abrir la siguiente sesión.
now-connecting = Conectando con el servidor…
now-nothing = Nada que hacer aún: espere a que el equipo inicie un ensayo.
now-press-continue = Pulse «Continuar» cuando pueda seguir.
now-wait-paused = Espere al equipo del ensayo. Puede seguir comentando.
now-wait-start = Espere a que el equipo inicie el ensayo.
now-tap-begin = Toque para empezar el ajuste { $setting }.
now-ends-soon = Este ajuste termina enseguida. Lo que está escribiendo se conserva.
now-look-write = Observe y escriba lo que note. Después termine el ajuste.
now-look-say = Observe y diga o escriba lo que note. Después termine el ajuste.
now-answer = Responda a las preguntas y pulse «Continuar».
now-answer-last = Responda a las últimas preguntas y pulse «Terminar».
now-keep-open = Deje esta página abierta hasta que todo esté guardado.
now-comment-left = Guarde o borre el comentario del cuadro.
now-practice-over = La práctica ha terminado. Conserve la tableta: ahora viene el ensayo.
now-done = Ha terminado. Devuelva la tableta.
now-unreachable = No se puede contactar con el servidor.
now-silent-since = Sin servidor desde las { $time }.
now-certificate-over = Su certificado ha caducado: avise al equipo del ensayo.
now-keeps-trying = Esta página sigue intentándolo.
now-comment-on = Los comentarios se guardan aquí y se envían después.

## The session

setting-of = Ajuste { $setting } de { $settings }
time-left = quedan { $time }
paused = En pausa
paused-by-you = Ha puesto la sesión en pausa. Puede seguir comentando.
paused-by-restart = El servidor se ha reiniciado. { $saved } Continúe donde estaba.
paused-by-absence = Esta tableta no estaba conectada, por eso la sesión se puso en pausa. { $saved } Continúe donde estaba.
paused-by-picture = La imagen era demasiado pequeña para este ensayo, por eso se puso en pausa. Continúe cuando mejore.
paused-by-operator = El equipo ha puesto la sesión en pausa. Puede seguir comentando.
ready =
    { $settings ->
        [one] Verá un ajuste. El equipo iniciará el ensayo.
       *[other] Verá { $settings } ajustes, uno tras otro. El equipo iniciará el ensayo.
    }
no-trial = No hay ningún ensayo en curso. Puede observar.
not-open-here = No disponible para esta tableta
few-questions = Ajuste { $setting }: unas preguntas
final-questions = Preguntas finales
practice-over = La práctica ha terminado
practice-over-more = Era una práctica; no cuenta. { $kept }
thank-you = Gracias
trial-complete = El ensayo ha terminado. { $kept }
session-ended = La sesión se ha interrumpido
nothing-more = No hay nada más que hacer. { $kept }
comment-in-box = Su último comentario sigue en el cuadro. Guárdelo o bórrelo.
continue = Continuar
finish = Terminar
unrecorded = Este paso aún no está registrado porque el servidor no puede escribir en su disco. Avise al equipo del ensayo.
act-unanswered = El servidor no responde. Inténtelo de nuevo en un momento.
tap-unanswered = El servidor no ha respondido. Toque otra vez.
one-moment = Un momento…
change-first = Este es el primer ajuste.
change-next = El ajuste ha cambiado.
change-write = Observe como en una operación y escriba lo que note.
change-say = Observe como en una operación y diga o escriba lo que note.

## What is saved, and what is not

saving = Guardando…
comments-saved =
    { $count ->
        [one] 1 comentario guardado
       *[other] { $count } comentarios guardados
    }
kept-refused =
    { $count ->
        [one] No se ha podido guardar 1 comentario o respuesta; queda en este dispositivo. Avise al equipo del ensayo.
       *[other] No se han podido guardar { $count } comentarios o respuestas; quedan en este dispositivo. Avise al equipo del ensayo.
    }
still-saving = Deje esta página abierta. Parte de lo que ha dicho aún se está guardando.
all-saved = Todo lo que ha dicho está guardado.
no-connection = Sin conexión. Esta página sigue intentándolo.
no-answer-yet = Aún no hay respuesta. Esta página sigue intentándolo.
held-comments =
    { $count ->
        [one] 1 comentario
       *[other] { $count } comentarios
    }
held-recordings =
    { $count ->
        [one] 1 grabación
       *[other] { $count } grabaciones
    }
held-here = Guardado aquí: { $what }.
held-on-page = Solo en esta página; no la cierre: { $what }.
sent-later = Se enviará cuando vuelva la red.
over-held =
    { $count ->
        [one] 1 comentario o respuesta sigue en esta tableta. Enviando…
       *[other] { $count } comentarios y respuestas siguen en esta tableta. Enviando…
    }
over-saved = Todo lo que había en esta tableta está guardado.
storage-advice = Este navegador no conserva nada en el dispositivo: su almacenamiento está lleno o desactivado, como en una ventana privada. Lo que diga espera en esta página hasta que se guarde. No cierre ni recargue la página.
screen-advice = Este navegador no mantiene la pantalla encendida. Configure la tableta para que la pantalla no se apague.

## Comments

write-what-you-see = Escriba lo que ve
write-comment = Escriba un comentario
comments-later = Los comentarios se guardan cuando empieza un ensayo
about-setting = Este comentario se refiere al ajuste { $setting }.
continue-draft = Continuar «{ $start }»
begun-elsewhere = Empezado en otra pestaña: { $whole }
undo-what = Deshacer: { $what }
the-mark = la marca
comment-not-saved = El comentario no se ha guardado y vuelve a estar en el cuadro: { $reason }
mark-not-saved = La marca no se ha guardado: { $reason }
comment-not-undone = El comentario no se ha retirado: { $reason }
quick-not-saved = «{ $text }» no se ha guardado: { $reason }

## Voice

hold-to-talk = Mantener para hablar
talk-wait = Espere…
talk-ends = Acaba en { $seconds } s
talk-recording = Grabando { $time }
recording = Grabando
saved-as-you-speak = Se guarda mientras habla.
saving-recording = Guardando la grabación…
recording-saved = Grabación guardada
recordings-refused =
    { $count ->
        [one] 1 grabación no se ha guardado y queda en este dispositivo. Avise al equipo del ensayo. { $reason }
       *[other] { $count } grabaciones no se han guardado y quedan en este dispositivo. Avise al equipo del ensayo. { $reason }
    }
talk-lost = Se ha perdido el micrófono. Lo que dijo hasta entonces se conserva.
talk-limit = La grabación terminó a los dos minutos. Lo que dijo se conserva. Suelte y vuelva a pulsar para continuar.
talk-left = La grabación terminó porque algo se puso delante de esta página. Lo que dijo hasta entonces se conserva. Vuelva a pulsar para continuar.
talk-nothing = No se ha grabado nada. Mantenga pulsado hasta que diga «Grabando» y hable.
try-microphone = Probar el micrófono
microphone-ready = El micrófono está listo.
microphone-failed = No se ha podido abrir el micrófono.
microphone-failed-type = No se ha podido abrir el micrófono. Escriba su comentario.
microphone-unencrypted = La voz necesita una conexión cifrada (https), que esta página no tiene. Escriba sus comentarios.
microphone-unable = Este navegador no puede grabar voz. Escriba sus comentarios.
microphone-reload = Vuelva a cargar esta página para usar el micrófono. Hasta entonces, escriba sus comentarios.
microphone-no-start = Este navegador no ha podido empezar a grabar. Escriba su comentario.
microphone-blocked = El micrófono está bloqueado para esta página. Permítalo en los ajustes del navegador o escriba su comentario.
microphone-none = Este dispositivo no tiene micrófono. Conecte uno o escriba su comentario.
microphone-busy = Otro programa usa el micrófono. Ciérrelo o escriba su comentario.

## Questions

optional = (opcional)
not-answered = Aún sin responder
answered-of = { $given } de { $total } respondidas
partly-answered = { $open } · { $state }
answer-saved = Guardado
answer-waiting = Guardado aquí. Se enviará cuando vuelva la conexión.
writing = Escribiendo…
earlier-stays = La respuesta anterior vale hasta que escriba otra.
questions-open =
    { $count ->
        [one] Queda una pregunta sin responder.
       *[other] Quedan { $count } preguntas sin responder.
    }
answers-kept = { $trouble } Sus respuestas están guardadas aquí.
answer-refused = Una respuesta no se ha guardado. El motivo se muestra arriba.
scale-point = { $point } de { $points }
scale-end = { $point } de { $points }, { $meaning }
line-value = { $value } de 100, de { $low } a { $high }
gradation = { $value } de 100
line-less = Menos: { $low }
line-more = Más: { $high }
not-marked = Aún sin marcar
no = No
not-sure = No lo sé
yes = Sí
recognised-this = ¿En qué ha reconocido este ajuste?
recognised-which = ¿Qué ajustes ha reconocido y en qué? Indique sus números.
pair-choose = En cada par, toque lo que más contribuyó a la carga.
pair-label = { $first } o { $second }
best = Mejor
worst = Peor
setting-number = Ajuste { $setting }
give-places = Dé un puesto a cada ajuste. Varios ajustes pueden compartir un puesto.
order-right = Este orden es correcto
order-kept = En este dispositivo hasta que toque «{ order-right }»
order-help = Arrastre un ajuste por su asa o use las flechas; ⤒ lo pone primero. El orden de abajo está sorteado.
order-moved = El ajuste { $setting } está ahora en el puesto { $place } de { $places }
move-up = Subir el ajuste { $setting }
move-down = Bajar el ajuste { $setting }
move-first = Poner primero el ajuste { $setting }
place = { $place }.º
place-best = { $place }, el mejor

## Answers of the server

link-refused = Este enlace ya no es válido aquí. Ábralo de nuevo o pida otro.
text-too-long = Este texto es demasiado largo. Envíelo en partes más cortas.
other-answered = Otra cosa ha respondido en lugar del servidor. Compruebe en qué red está este dispositivo.
server-error = El servidor ha respondido con un error ({ $status }).
server-silent = Sin conexión con el servidor. Inténtelo de nuevo en un momento.
refused-no-session = no existe esa sesión; vuelva a cargar la página
refused-no-setting = esta sesión no tiene ese ajuste; vuelva a cargar la página
refused-no-question = esta sesión no hace esa pregunta sobre este ajuste; vuelva a cargar la página
refused-paused = la sesión está en pausa
refused-aborted = la sesión se ha interrumpido
refused-ended = la sesión ha terminado
refused-not-started = la sesión no ha empezado
refused-not-reached = aún no se ha llegado a este ajuste
refused-not-begun = este ajuste aún no ha empezado
refused-not-asked = aún no se han hecho las preguntas sobre este ajuste
refused-closing-not-asked = aún no se han hecho las preguntas finales
refused-question-not-asked = esta pregunta aún no se ha hecho
refused-still-open = falta responder: { $question }
refused-centre = el protocolo mantiene el enfoque en el centro de la imagen
refused-no-hold = el protocolo no permite mantener el enfoque
refused-point-not-looking = el enfoque solo se mueve mientras se observa un ajuste
refused-hold-not-looking = el enfoque solo se mantiene mientras se observa un ajuste
refused-outside = el lugar está fuera de la imagen
refused-under-way = hay una sesión en curso; vuelva a cargar la página
refused-empty = el comentario está vacío
refused-no-voice = este ensayo no graba voz; escriba el comentario
refused-too-long = el texto tiene { $length } bytes; el límite es { $limit }, divídalo

## Pages that say why something was not done

error-nothing-here = Aquí no hay nada
error-not-open = No disponible para este navegador
error-not-now = No es posible ahora
error-server-failed = Error del servidor
error-did-not-work = No ha funcionado
error-start-page = Ir a la página de inicio
error-sign-in = Iniciar sesión
error-needs-surgeon = Esta página es para el cirujano. Ábrala con su enlace: lo tiene el equipo del ensayo.
error-no-role = Este navegador aún no tiene acceso. Ábralo con el enlace de su función: el servidor muestra los tres al iniciarse; un cirujano lo recibe del equipo del ensayo.
error-wrong-key = Este enlace no es válido o ya no lo es. Un cirujano recibe el enlace del equipo del ensayo; el servidor los mostró todos la última vez que se inició.
error-session-over = Este enlace era para una sesión, que ha terminado. Esta tableta aún puede enviar lo que guarda de esa sesión. Para la siguiente sesión, el equipo del ensayo muestra un código nuevo.
error-needs-session-link = La sesión en curso tiene su propio enlace. Escanee el código de la página del equipo del ensayo.
error-cross-site = Esta petición vino de otro sitio y no se ha realizado. Vuelva a la página e inténtelo desde allí.
error-busy = Hay demasiadas páginas abiertas a la vez. Cierre algunas e inténtelo de nuevo.
error-storage = No se ha podido guardar: { $reason }
error-internal = El servidor no ha podido atender esta petición. Lo guardado antes está a salvo. El registro del servidor dice más.
error-misspelled = Esta dirección está incompleta o mal escrita. Abra otra vez el enlace tal como lo recibió o vaya a la página de inicio.
error-no-address = No hay nada en esta dirección.
error-timeout = El servidor ha tardado demasiado; inténtelo de nuevo.
session-over-title = Sesión terminada

## The page that tries a tablet

tablet-intro = Una vez por tableta, antes de su primer ensayo: toque el botón y permita el micrófono si la tableta lo pide.
tablet-go = Probar todo
tablet-too-old = ¿No ocurre nada al tocar? Entonces este navegador es demasiado antiguo: iPadOS 16.4, Chrome 108, Firefox 121 o posterior.
tablet-guided-access = En un iPad, Acceso guiado mantiene la tableta en esta página: Ajustes, Accesibilidad, Acceso guiado. Después pulse tres veces el botón superior en la página del cirujano.
tablet-open-page = Abrir la página del cirujano
tablet-trying = Probando…
tablet-works = { $part }: funciona
tablet-fails = { $part }: { $advice }
tablet-told = La página del equipo del ensayo también lo muestra, en la tarjeta «Ready for a trial?».
tablet-not-told = El servidor no ha respondido, por eso el equipo del ensayo aún no lo sabe. Inténtelo de nuevo.
tablet-encrypted = Conexión cifrada
    .advice = abra la página con https, o no funcionarán la voz ni la apertura sin red
tablet-storage = Almacenamiento de comentarios
    .advice = salga de la navegación privada o libere espacio: al recargar se perderían comentarios
tablet-disk = Almacenamiento de voz
    .advice = salga de la navegación privada o libere espacio: al recargar se perderían grabaciones
tablet-stream = Conexión en directo
    .advice = la red no deja pasar conexiones WebSocket; use otra
tablet-picture = Mostrar imágenes
    .advice = este navegador es demasiado antiguo: iPadOS 16.4, Chrome 108, Firefox 121 o posterior
tablet-microphone = Micrófono
    .advice = permítalo para esta página en los ajustes del navegador; sin él se pueden escribir los comentarios
tablet-screen-on = Mantener la pantalla encendida
    .advice = configure la tableta para que la pantalla no se apague
tablet-all-works = Todo funciona en esta tableta.
tablet-unfit = Tal como está, esta tableta no sirve para un ensayo.
tablet-mostly = Se puede hacer un ensayo en esta tableta. Mire qué no funciona.
