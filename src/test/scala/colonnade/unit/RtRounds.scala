package colonnade.unit

import chisel3._
import chiseltest._
import colonnade.shading.Occlusion

import scala.util.Random

/** Where a context is, and what is known of its path. */
private class RtContext(lights: Int) {
  var place        = Stage.free
  var isShadow     = false
  var isPrimary    = false
  var isColoured   = false
  var isBackground = false
  var hasHit       = false
  var occlusion    = Occlusion.none
  var wanted       = Seq.empty[Int]
  var asked        = 0
  var occlusions   = Seq.fill(lights)(Occlusion.none)
  var waited       = 0

  /** The pixel shows the room; its ray is beside the path. */
  var isSeen  = false
  var isAside = false

  /** Its first ray goes past the object. */
  var passes = false

  /** What the shader will make of it, where that is known: a turn, or a surface. */
  var willTurn = Option.empty[Boolean]
}

/** Where the contexts are, next to the controller; makes events that can happen there.
  *
  * @param isThere a room, in a controller that knows of rooms
  */
private class RtRounds(dut: RtController, count: Int, seed: Int, isThere: Boolean = false) {
  private val random   = new Random(seed)
  private val lights   = dut.io.shaded.bits.needsShadowRays.size
  private val contexts = Seq.fill(count)(new RtContext(lights))
  private var begun    = 0
  private var left     = 0

  /** How the room was met: beside a path or at its end, and whether there was a point. */
  var seen = Set.empty[(Boolean, Boolean)]

  private def where(claim: RtContext => Boolean): Seq[Int] = contexts.indices.filter(index => claim(contexts(index)))

  private def at(place: Stage.Type): Seq[Int] = where(_.place == place)

  private def seeking: Seq[Int] = where(context => context.place == Stage.lit && context.wanted.nonEmpty)

  private def ending: Seq[Int] =
    where(context => context.place == Stage.colouring || (isLit(context) && !context.isAside))

  private def turning: Seq[Int] =
    where(context => context.place == Stage.turning || (isLit(context) && context.isAside))

  private def isLit(context: RtContext): Boolean = context.place == Stage.lit && context.wanted.isEmpty

  def run(pixels: Int, eagerness: Double): Unit = {
    def happens = random.nextDouble() < eagerness
    while (left < pixels) cycle { events =>
      events.allocate = begun < pixels && happens
      events.leave = happens
      events.shadow = happens
      events.end = happens
      events.question = happens
      events.turn = happens
      // Each event is of another context: ray set-up names one, and so do traversal, the triangle unit, the shader
      val (starting, passing) = random.shuffle(at(Stage.setUp)).partition(!contexts(_).passes)
      for (context <- starting.headOption if happens)
        if (random.nextInt(3) > 0) events.entered = Some(context) else events.ended(0) = Some(context)
      for (context <- passing.headOption if happens) events.passes = Some(context)
      val travellers = random.shuffle(at(Stage.traversal))
      for (context <- travellers.headOption if happens) events.ended(1) = Some(context)
      for (context <- travellers.drop(1).headOption if happens) events.ended(2) = Some(context)
      val shading = random.shuffle(at(Stage.shading))
      for (context <- shading.headOption if happens) leaveShader(context, events)
      for (context <- shading.drop(1).find(contexts(_).willTurn.isEmpty) if happens && random.nextInt(3) == 0)
        events.dropped = Some(context)
      for (context <- one(at(Stage.room)) if happens)
        if (random.nextBoolean()) events.met = Some(context) else events.nothing = Some(context)
      for (context <- one(at(Stage.coloured)) if happens) events.coloured = Some(context)
    }
    assert(begun == pixels && at(Stage.free).size == count, "every pixel has left")
  }

  private def leaveShader(index: Int, events: RtEvents): Unit = {
    val context = contexts(index)
    if (!context.willTurn.getOrElse(random.nextInt(3) == 0))
      events.shaded = Some((index, Seq.fill(lights)(!context.isAside && random.nextBoolean())))
    else if (isThere && context.willTurn.isEmpty && random.nextInt(4) > 0) events.aside = Some(index)
    else events.bounced = Some((index, random.nextInt(3) > 0))
  }

  /** One cycle: what is shown is compared, `happen` says what comes in. */
  def cycle(happen: RtEvents => Unit): Unit = {
    dut.io.freeCount.expect(at(Stage.free).size)
    val free     = shown(dut.io.free.valid, dut.io.free.bits, at(Stage.free))
    val judged   = shown(dut.io.judged.valid, dut.io.judged.bits, at(Stage.ended))
    val complete = shown(dut.io.complete.valid, dut.io.complete.bits, at(Stage.complete))
    val seeker   = shown(dut.io.shadow.valid, dut.io.shadow.bits.context, seeking)
    val ended    = shown(dut.io.end.valid, dut.io.end.bits.context, ending)
    val asker    = dut.io.room.flatMap(room =>
      shown(room.question.valid, room.question.bits.context, at(Stage.beyond))
    )
    val turned = dut.io.room.flatMap(room => shown(room.turn.valid, room.turn.bits.context, turning))
    dut.io.roomCount.foreach(_.expect(at(Stage.beyond).size + at(Stage.room).size))
    for ((context, index) <- contexts.zipWithIndex if context.place != Stage.free) {
      dut.io.isShadow(index).expect(context.isShadow, s"context $index at ${context.place}")
      dut.io.isPrimary(index).expect(context.isPrimary, s"context $index at ${context.place}")
      dut.io.isColoured(index).expect(context.isColoured, s"context $index at ${context.place}")
      context.waited += 1
      assert(context.waited < 2000, s"context $index is stuck at ${context.place}")
    }
    for (index <- seeker) assert(contexts(index).wanted.contains(dut.io.shadow.bits.light.peekInt().toInt))
    for (index <- ended) {
      dut.io.end.bits.isBackground.expect(contexts(index).isBackground)
      dut.io.end.bits.isDirectView.foreach(_.expect(contexts(index).isSeen))
      if (!contexts(index).isBackground)
        dut.io.end.bits.occlusions.zip(contexts(index).occlusions).foreach { case (port, met) => port.expect(met) }
    }

    for (room <- dut.io.room; index <- asker) {
      room.question.bits.isSeen.expect(contexts(index).isPrimary)
      room.question.bits.isAside.expect(contexts(index).isAside)
    }
    for (room <- dut.io.room; index <- turned) room.turn.bits.isBackground.expect(contexts(index).isBackground)

    val events = new RtEvents
    happen(events)
    val allocated = free.filter(_ => events.allocate)
    val leaves    = complete.filter(_ => events.leave)
    val light     = dut.io.shadow.bits.light.peekInt().toInt
    events.poke(dut, allocated.nonEmpty, leaves.nonEmpty, isThere)(random.nextInt(count))
    dut.clock.step()

    def change(index: Option[Int])(how: RtContext => Unit): Unit = index.foreach(index => how(contexts(index)))
    change(allocated) { context =>
      context.place = Stage.setUp
      context.isShadow = false
      context.isPrimary = true
      context.isColoured = false
      context.isSeen = false
      context.isAside = false
      context.passes = isThere && random.nextInt(3) == 0
      begun += 1
    }
    change(events.entered)(_.place = Stage.traversal)
    change(judged)(judge)
    events.ended.flatten.foreach { index =>
      val context = contexts(index)
      context.place = Stage.ended
      context.hasHit = random.nextBoolean()
      context.occlusion = random.shuffle(Occlusion.all).head
      dut.io.hasHit(index).poke(context.hasHit)
      dut.io.occlusions(index).poke(context.occlusion)
    }
    for ((index, needs) <- events.shaded) change(Some(index)) { context =>
      context.place = Stage.lit
      context.isBackground = false
      context.wanted = needs.indices.filter(needs(_))
      context.occlusions = Seq.fill(lights)(Occlusion.none)
    }
    for ((index, isTraced) <- events.bounced) change(Some(index)) { context =>
      context.place = if (isTraced) Stage.setUp else if (isThere) Stage.beyond else Stage.colouring
      context.isPrimary = false
      context.isBackground = true
    }
    change(events.dropped) { context =>
      context.place = Stage.colouring
      context.isBackground = true
    }
    change(seeker.filter(_ => events.shadow)) { context =>
      context.place = Stage.setUp
      context.isShadow = true
      context.asked = light
      context.wanted = context.wanted.filter(_ != light)
    }
    change(ended.filter(_ => events.end))(_.place = Stage.coloured)
    change(events.coloured) { context =>
      context.place = Stage.complete
      context.isColoured = true
    }
    change(events.passes) { context =>
      context.place = Stage.beyond
      context.passes = false
    }
    change(events.aside) { context =>
      context.place = Stage.beyond
      context.isAside = true
      context.isPrimary = false
    }
    change(asker.filter(_ => events.question)) { context =>
      context.place = Stage.room
      context.isSeen = context.isPrimary
      context.isShadow = false
    }
    change(events.met) { context =>
      context.place = Stage.shading
      context.willTurn = Some(false)
      seen += ((context.isAside, true))
    }
    change(events.nothing) { context =>
      context.place = if (context.isAside) Stage.turning else afterNothing(context)
      context.isBackground = true
      seen += ((context.isAside, false))
    }
    change(turned.filter(_ => events.turn)) { context =>
      context.place = Stage.shading
      context.isAside = false
      context.willTurn = Some(true)
    }
    change(leaves) { context =>
      context.place = Stage.free
      context.waited = 0
      left += 1
    }
  }

  private def judge(context: RtContext): Unit =
    if (context.isShadow) {
      context.place = Stage.lit
      context.occlusions = context.occlusions.updated(context.asked, context.occlusion)
    } else if (context.hasHit) {
      context.place = Stage.shading
      context.willTurn = None
    } else {
      context.place = if (isThere) Stage.beyond else afterNothing(context)
      context.isBackground = true
    }

  private def afterNothing(context: RtContext): Stage.Type =
    if (context.isPrimary) Stage.complete else Stage.colouring

  /** The context that the controller names as one of some, if there are any. */
  private def shown(valid: Bool, bits: UInt, these: Seq[Int]): Option[Int] = {
    valid.expect(these.nonEmpty, s"contexts $these")
    Option.when(valid.peekBoolean()) {
      val context = bits.peekInt().toInt
      assert(these.contains(context), s"context $context is shown as one of $these")
      context
    }
  }

  private def one(candidates: Seq[Int]): Option[Int] = random.shuffle(candidates).headOption
}
