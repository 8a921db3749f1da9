package colonnade.unit

import chisel3._
import chisel3.util.Valid
import chiseltest._
import colonnade.TestConfigs
import colonnade.config.ColonnadeConfig
import colonnade.shading.Occlusion
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** A context is always at one place of its round, and goes on when something happens to it, and only then. */
class RtControllerSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "RtController"

  private def config(contexts: Int): ColonnadeConfig =
    TestConfigs.tiny.copy(array = TestConfigs.tiny.array.copy(contexts = contexts))

  for (contexts <- Seq(1, 3, 16))
    it should s"follow $contexts contexts through random events" in
      test(new RtController(config(contexts))) { dut =>
        for ((eagerness, seed) <- Seq((0.9, 1), (0.15, 2)))
          new RtRounds(dut, contexts, seed).run(pixels = 70, eagerness)
      }

  it should "judge one ended ray and let one pixel leave a cycle" in
    test(new RtController(config(contexts = 4))) { dut =>
      val rounds = new RtRounds(dut, count = 4, seed = 1)
      for (_ <- 0 until 3) rounds.cycle(_.allocate = true)
      rounds.cycle(_.ended(1) = Some(0))
      rounds.cycle(_.leave = true)
      dut.io.freeCount.expect(1)
      rounds.cycle { events =>
        events.ended(0) = Some(1)
        events.ended(2) = Some(2)
      }
      for (_ <- 0 until 2) {
        dut.io.judged.valid.expect(true)
        rounds.cycle(_.leave = true)
      }
      dut.io.judged.valid.expect(false)
      rounds.cycle(_.leave = true)
      dut.io.freeCount.expect(3)
    }
}

/** What happens to the controller in one cycle, from outside. */
private class RtEvents {
  var allocate = false
  var leave    = false
  var entered  = Option.empty[Int]
  val ended    = Array.fill(3)(Option.empty[Int])
  var shaded   = Option.empty[(Int, Seq[Boolean])]
  var bounced  = Option.empty[(Int, Boolean)]
  var dropped  = Option.empty[Int]
  var shadow   = false
  var end      = false
  var coloured = Option.empty[Int]
}

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
}

/** Where the contexts are, next to the controller; makes events that can happen there. */
private class RtRounds(dut: RtController, count: Int, seed: Int) {
  private val random   = new Random(seed)
  private val lights   = dut.io.shaded.bits.needsShadowRays.size
  private val contexts = Seq.fill(count)(new RtContext(lights))
  private var begun    = 0
  private var left     = 0

  private def where(claim: RtContext => Boolean): Seq[Int] = contexts.indices.filter(index => claim(contexts(index)))

  private def at(place: Stage.Type): Seq[Int] = where(_.place == place)

  private def seeking: Seq[Int] = where(context => context.place == Stage.lit && context.wanted.nonEmpty)

  private def ending: Seq[Int] =
    where(context => context.place == Stage.colouring || (context.place == Stage.lit && context.wanted.isEmpty))

  def run(pixels: Int, eagerness: Double): Unit = {
    def happens = random.nextDouble() < eagerness
    while (left < pixels) cycle { events =>
      events.allocate = begun < pixels && happens
      events.leave = happens
      events.shadow = happens
      events.end = happens
      // Each event is of another context: ray set-up names one, and so do traversal, the triangle unit, the shader
      for (context <- one(at(Stage.setUp)) if happens)
        if (random.nextInt(3) > 0) events.entered = Some(context) else events.ended(0) = Some(context)
      val travellers = random.shuffle(at(Stage.traversal))
      for (context <- travellers.headOption if happens) events.ended(1) = Some(context)
      for (context <- travellers.drop(1).headOption if happens) events.ended(2) = Some(context)
      val shading = random.shuffle(at(Stage.shading))
      for (context <- shading.headOption if happens)
        if (random.nextInt(3) > 0) events.shaded = Some((context, Seq.fill(lights)(random.nextBoolean())))
        else events.bounced = Some((context, random.nextInt(3) > 0))
      for (context <- shading.drop(1).headOption if happens && random.nextInt(3) == 0) events.dropped = Some(context)
      for (context <- one(at(Stage.coloured)) if happens) events.coloured = Some(context)
    }
    assert(begun == pixels && at(Stage.free).size == count, "every pixel has left")
  }

  /** One cycle: what is shown is compared, `happen` says what comes in. */
  def cycle(happen: RtEvents => Unit): Unit = {
    dut.io.freeCount.expect(at(Stage.free).size)
    val free     = shown(dut.io.free.valid, dut.io.free.bits, at(Stage.free))
    val judged   = shown(dut.io.judged.valid, dut.io.judged.bits, at(Stage.ended))
    val complete = shown(dut.io.complete.valid, dut.io.complete.bits, at(Stage.complete))
    val seeker   = shown(dut.io.shadow.valid, dut.io.shadow.bits.context, seeking)
    val ended    = shown(dut.io.end.valid, dut.io.end.bits.context, ending)
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
      if (!contexts(index).isBackground)
        dut.io.end.bits.occlusions.zip(contexts(index).occlusions).foreach { case (port, met) => port.expect(met) }
    }

    val events = new RtEvents
    happen(events)
    val allocated = free.filter(_ => events.allocate)
    val leaves    = complete.filter(_ => events.leave)
    val light     = dut.io.shadow.bits.light.peekInt().toInt
    poke(events, allocated.nonEmpty, leaves.nonEmpty)
    dut.clock.step()

    def change(index: Option[Int])(how: RtContext => Unit): Unit = index.foreach(index => how(contexts(index)))
    change(allocated) { context =>
      context.place = Stage.setUp
      context.isShadow = false
      context.isPrimary = true
      context.isColoured = false
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
      context.place = if (isTraced) Stage.setUp else Stage.colouring
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
    } else if (context.hasHit) context.place = Stage.shading
    else {
      context.place = if (context.isPrimary) Stage.complete else Stage.colouring
      context.isBackground = true
    }

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

  private def poke(events: RtEvents, allocates: Boolean, leaves: Boolean): Unit = {
    def name(port: Valid[UInt], context: Option[Int]): Unit = {
      port.valid.poke(context.nonEmpty)
      port.bits.poke(context.getOrElse(random.nextInt(count)))
    }
    dut.io.allocate.poke(allocates)
    dut.io.leave.poke(leaves)
    dut.io.shadow.ready.poke(events.shadow)
    dut.io.end.ready.poke(events.end)
    name(dut.io.entered, events.entered)
    dut.io.ended.zip(events.ended).foreach { case (port, context) => name(port, context) }
    dut.io.shaded.valid.poke(events.shaded.nonEmpty)
    for ((context, needs) <- events.shaded) {
      dut.io.shaded.bits.context.poke(context)
      dut.io.shaded.bits.needsShadowRays.zip(needs).foreach { case (port, need) => port.poke(need) }
    }
    dut.io.bounced.valid.poke(events.bounced.nonEmpty)
    for ((context, isTraced) <- events.bounced) {
      dut.io.bounced.bits.context.poke(context)
      dut.io.bounced.bits.isTraced.poke(isTraced)
    }
    name(dut.io.dropped, events.dropped)
    name(dut.io.coloured, events.coloured)
  }
}
