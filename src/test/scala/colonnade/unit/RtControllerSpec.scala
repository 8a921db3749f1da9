package colonnade.unit

import chisel3._
import chisel3.util.Valid
import chiseltest._
import colonnade.TestConfigs
import colonnade.config.ColonnadeConfig
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
      val rounds = new RtRounds(dut, contexts = 4, seed = 1)
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
  var shaded   = Option.empty[(Int, Boolean)]
  var dropped  = Option.empty[Int]
}

/** Where the contexts are, next to the controller; makes events that can happen there. */
private class RtRounds(dut: RtController, contexts: Int, seed: Int) {
  private val random   = new Random(seed)
  private val places   = Array.fill(contexts)(Stage.free)
  private val isShadow = Array.fill(contexts)(false)
  private val hasHit   = Array.fill(contexts)(false)
  private val waited   = Array.fill(contexts)(0)
  private var begun    = 0
  private var left     = 0

  private def at(place: Stage.Type): Seq[Int] = places.indices.filter(places(_) == place)

  def run(pixels: Int, eagerness: Double): Unit = {
    def happens = random.nextDouble() < eagerness
    while (left < pixels) cycle { events =>
      events.allocate = begun < pixels && happens
      events.leave = happens
      // Each event is of another context: ray set-up names one, and so do traversal, the triangle unit, the shader
      for (context <- one(at(Stage.setUp)) if happens)
        if (random.nextInt(3) > 0) events.entered = Some(context) else events.ended(0) = Some(context)
      val travellers = random.shuffle(at(Stage.traversal))
      for (context <- travellers.headOption if happens) events.ended(1) = Some(context)
      for (context <- travellers.drop(1).headOption if happens) events.ended(2) = Some(context)
      val shading = random.shuffle(at(Stage.shading))
      for (context <- shading.headOption if happens) events.shaded = Some((context, random.nextBoolean()))
      for (context <- shading.drop(1).headOption if happens && random.nextInt(3) == 0) events.dropped = Some(context)
    }
    assert(begun == pixels && at(Stage.free).size == contexts, "every pixel has left")
  }

  /** One cycle: what is shown is compared, `happen` says what comes in. */
  def cycle(happen: RtEvents => Unit): Unit = {
    dut.io.freeCount.expect(at(Stage.free).size)
    val free     = shown(dut.io.free, Stage.free)
    val judged   = shown(dut.io.judged, Stage.ended)
    val complete = shown(dut.io.complete, Stage.complete)
    for (context <- places.indices if places(context) != Stage.free) {
      dut.io.isShadow(context).expect(isShadow(context), s"context $context at ${places(context)}")
      waited(context) += 1
      assert(waited(context) < 1000, s"context $context is stuck at ${places(context)}")
    }

    val events = new RtEvents
    happen(events)
    val allocated = free.filter(_ => events.allocate)
    val leaves    = complete.filter(_ => events.leave)
    poke(events, allocated.nonEmpty, leaves.nonEmpty)
    dut.clock.step()

    allocated.foreach { context =>
      move(context, Stage.setUp, isOfShadow = false)
      begun += 1
    }
    events.entered.foreach(move(_, Stage.traversal))
    events.ended.flatten.foreach { context =>
      move(context, Stage.ended)
      hasHit(context) = random.nextBoolean()
      dut.io.hasHit(context).poke(hasHit(context))
    }
    judged.foreach { context =>
      move(context, if (hasHit(context) && !isShadow(context)) Stage.shading else Stage.complete)
    }
    events.shaded.foreach { case (context, needsShadowRay) =>
      move(context, if (needsShadowRay) Stage.setUp else Stage.complete, isOfShadow = needsShadowRay)
    }
    events.dropped.foreach(move(_, Stage.complete))
    leaves.foreach { context =>
      move(context, Stage.free)
      waited(context) = 0
      left += 1
    }
  }

  /** The context that the controller names as being at a place, if there is one. */
  private def shown(port: Valid[UInt], place: Stage.Type): Option[Int] = {
    port.valid.expect(at(place).nonEmpty, s"contexts $place: ${at(place)}")
    Option.when(port.valid.peekBoolean()) {
      val context = port.bits.peekInt().toInt
      assert(at(place).contains(context), s"context $context is shown as $place")
      context
    }
  }

  private def move(context: Int, place: Stage.Type): Unit = places(context) = place

  private def move(context: Int, place: Stage.Type, isOfShadow: Boolean): Unit = {
    move(context, place)
    isShadow(context) = isOfShadow
  }

  private def one(candidates: Seq[Int]): Option[Int] = random.shuffle(candidates).headOption

  private def poke(events: RtEvents, allocates: Boolean, leaves: Boolean): Unit = {
    def name(port: Valid[UInt], context: Option[Int]): Unit = {
      port.valid.poke(context.nonEmpty)
      port.bits.poke(context.getOrElse(random.nextInt(contexts)))
    }
    dut.io.allocate.poke(allocates)
    dut.io.leave.poke(leaves)
    name(dut.io.entered, events.entered)
    dut.io.ended.zip(events.ended).foreach { case (port, context) => name(port, context) }
    dut.io.shaded.valid.poke(events.shaded.nonEmpty)
    for ((context, needsShadowRay) <- events.shaded) {
      dut.io.shaded.bits.context.poke(context)
      dut.io.shaded.bits.needsShadowRay.poke(needsShadowRay)
    }
    name(dut.io.dropped, events.dropped)
  }
}
