package colonnade.ray

import chisel3._
import chiseltest._
import colonnade.TestParts._
import colonnade.{Always, Matrix, Simulation, TestConfigs}
import colonnade.config.{ColonnadeConfig, UnitsConfig}
import colonnade.numbers.Fixed
import org.scalatest.Tag
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.util.Random

/** Adds the ray in the format of the box test. */
private class RaySetupHarness(config: ColonnadeConfig) extends Module {
  private val setup = Module(RaySetup(config))

  /** The unit that the factory has chosen. */
  val leaf: String = setup.desiredName

  val io       = IO(chiselTypeOf(setup.io))
  val forBoxes = IO(Output(new BoxRay(config.numbers)))
  io :<>= setup.io
  forBoxes := setup.io.ray.bits.ray.forBoxes
}

/** Prepared rays equal the model's, bit for bit. */
class RaySetupSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  import RaySetupSpec._

  for (interval <- UnitsConfig.rayIntervals) {
    val leaf = if (interval == 1) "RaySetupPipeline" else "SequentialRaySetup"
    behavior of leaf

    formatsOf(interval).foreach { formats =>
      it should s"equal the model under random stalls, also at inverted bounds, ${nameOf(formats, interval)}" taggedAs
        tag(formats, interval) in {
          val config = withInterval(formats, interval)
          test(new RaySetupHarness(config)).withAnnotations(Simulation.verilator) { setup =>
            val random = new Random(2)
            val boxes  = new SetupStimulus(config, random)
            val cases  = boxes.all(raysPerBox = if (interval == 1) 40 else 14)
            val rates  = Seq(Rates(1, 1), Rates(2, 3), Rates(25, 1), Rates(1, 25))
            cases.zip(rates).foreach { case (box, rate) => run(setup, box, box.answers(config), random, rate) }
            boxes.inverted(raysPerBox = 6).foreach(box => run(setup, box, box.answers(config), random, Rates(1, 1)))
          }
        }
    }

    it should s"prepare rays in the axes of instances among those of the world, interval $interval" in {
      val config = TestConfigs.withInstances(withInterval(narrowTests, interval), 3)
      test(new RaySetupHarness(config)).withAnnotations(Simulation.verilator) { setup =>
        val random        = new Random(4)
        val stimulus      = new SetupStimulus(config, random)
        val of            = stimulus.all(raysPerBox = 40)
        val (cube, world) = (of.head, of.last)
        val visits = cube.copy(requests = cube.requests.map(_.copy(isShadow = false, visit = Some(random.nextInt(3)))))
        val mixed  = random.shuffle(Seq(visits, world).flatMap(each => each.requests.zip(each.answers(config))))
        val (requests, answers) = mixed.unzip
        answers.count(_.head == 1) should be > 30
        run(setup, world.copy(requests = requests), answers, random, Rates(2, 3))
      }
    }

    val limits = Seq(TestConfigs.tiny -> interval.min(16)) ++ Seq(slowest -> interval).filter(_ => interval > 1)
    for ((formats, limit) <- limits)
      it should s"accept a ray every $limit cycles, ${nameOf(formats, interval)}, and lose none" in {
        val config = withInterval(formats, interval)
        test(new RaySetupHarness(config)).withAnnotations(Simulation.verilator) { setup =>
          setup.leaf shouldBe leaf
          val random   = new Random(3)
          val box      = new SetupStimulus(config, random).all(raysPerBox = 40).head
          val answers  = box.answers(config)
          val inBox    = answers.map(_.head == 1)
          val left     = run(setup, box, answers, random, Rates(1, 1))
          val starting = 4
          inBox.count(identity) should be > 20
          val intervals = left.zip(left.tail).drop(starting).map { case (one, next) => next - one }
          info(s"at most ${intervals.max} cycles")
          intervals.max should be <= limit
        }
      }
  }

  /** Sends all requests and checks all results; returns the cycles of the results. */
  private def run(
      setup:   RaySetupHarness,
      box:     SetupCase,
      answers: Seq[Seq[BigInt]],
      random:  Random,
      rates:   Rates
  ): Seq[Int] = {
    setup.io.bounds.low.axes.zip(box.low).foreach { case (port, value) => port.poke(value) }
    setup.io.bounds.high.axes.zip(box.high).foreach { case (port, value) => port.poke(value) }
    val requests               = box.requests
    var left                   = Seq.empty[Int]
    var (sent, offered, cycle) = (0, -1, 0)
    while (left.size < requests.size) {
      cycle should be < 200 * requests.size
      val offers  = sent < requests.size && random.nextInt(rates.offer) == 0
      val accepts = random.nextInt(rates.accept) == 0
      setup.io.request.valid.poke(offers)
      setup.io.ray.ready.poke(accepts)
      // An offer may be withdrawn; bits without valid must have no effect
      val shown = if (offers) sent else requests.size - 1
      if (shown != offered) offer(setup.io.request.bits, requests(shown))
      offered = shown
      if (accepts && setup.io.ray.valid.peekBoolean()) {
        expect(setup.io.ray.bits, setup.forBoxes, requests(left.size), answers(left.size))
        left :+= cycle
      }
      if (offers && setup.io.request.ready.peekBoolean()) sent += 1
      setup.clock.step()
      cycle += 1
    }
    left
  }

  private def expect(
      ray:     PreparedRay,
      boxes:   BoxRay,
      request: SetupRequest,
      answer:  Seq[BigInt]
  ): Unit = withClue(s"$request: ") {
    ray.context.peekInt() shouldBe request.context
    ray.isShadow.peekBoolean() shouldBe request.isShadow
    ray.enters.peekInt() shouldBe answer.head
    for (visit <- ray.visit) {
      visit.valid.peekBoolean() shouldBe request.visit.nonEmpty
      request.visit.foreach(visit.bits.expect(_))
    }
    if (answer.head == 1) {
      val traced  = ray.ray
      val units   = boxes.origin.zip(boxes.roundsUp).map { case (below, up) => raw(below) + up.peekInt() }
      val numbers = Seq(traced.orientation.axis.peekInt()) ++ traced.orientation.negative.map(_.peekInt()) ++
        traced.origin.map(raw) ++ units ++ traced.shear.map(raw) ++ traced.reciprocal.map(raw) ++
        traced.exponent.map(_.peekInt()) ++ Seq(raw(ray.tEntry), raw(ray.tMax))
      numbers shouldBe answer.tail
    }
  }
}

object RaySetupSpec {

  /** The triangle tests of the presets. */
  private val narrowTests: ColonnadeConfig =
    TestConfigs.tiny.copy(geometry = TestConfigs.tiny.geometry.copy(triangleBits = Some(24)))

  private val extraSlices = TestConfigs.withExtraSlices(narrowTests)

  /** The most slices of a shear factor, with extra slices. */
  private val slowest: ColonnadeConfig = {
    val wide = TestConfigs.withExtraSlices(TestConfigs.withPrecision(64, 64, 64))
    wide.copy(geometry = wide.geometry.copy(vertexBits = 10))
  }

  private def formatsOf(interval: Int): Seq[ColonnadeConfig] =
    TestConfigs.formats ++ (narrowTests +: Seq(extraSlices).filter(_ => interval > 1))

  private def tag(config: ColonnadeConfig, interval: Int): Tag =
    if (config == narrowTests || config == extraSlices) Always
    else if (interval == 1) Matrix else Always.ifExtreme(config)

  private def withInterval(config: ColonnadeConfig, interval: Int): ColonnadeConfig =
    config.copy(units = config.units.copy(rayInterval = interval))

  private def nameOf(config: ColonnadeConfig, interval: Int): String =
    s"interval $interval, ${config.precision} with ${config.geometry.vertexBits}-bit vertices and " +
      s"${config.numbers.gridBits}-bit triangle tests" + (if (config.units.extraSlices) ", extra slices" else "")

  /** A request is offered in one of `offer` cycles, a ray is accepted in one of `accept` cycles. */
  private case class Rates(offer: Int, accept: Int)

  private def raw(number: Fixed): BigInt = number.raw match {
    case signed: SInt => signed.peekInt()
    case other        => other.asInstanceOf[UInt].peekInt()
  }

  private def offer(port: RayRequest, request: SetupRequest): Unit = {
    port.context.poke(request.context)
    port.isShadow.poke(request.isShadow)
    port.origin.axes.zip(request.origin).foreach { case (to, from) => to.raw.asInstanceOf[SInt].poke(from) }
    port.dir.axes.zip(request.dir).foreach { case (to, from) => to.poke(from) }
    for (visit <- port.visit) {
      visit.valid.poke(request.visit.nonEmpty)
      visit.bits.instance.poke(request.visit.getOrElse(0))
      visit.bits.tMax.poke((BigInt(1) << visit.bits.tMax.getWidth) - 1)
    }
  }
}
