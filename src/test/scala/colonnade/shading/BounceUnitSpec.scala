package colonnade.shading

import chiseltest._
import colonnade.TestParts._
import colonnade.config.ColonnadeConfig
import colonnade.numbers.StreamTester
import colonnade.{Model, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

class BounceUnitSpec extends AnyFlatSpec with ChiselScalatestTester {
  import BounceStimulus.poke
  import ResultPacking._

  behavior of "BounceUnit"

  private val simulation = Simulation.verilator

  private def peek(result: BounceResult): BigInt = pack(
    (result.isRefraction.peekInt() +: result.origin.axes.map(_.peekInt())) ++
      (result.dir.axes ++ result.reflection.axes).map(_.peekInt()) ++
      Seq(result.fresnel.natural.peekInt(), result.context.peekInt())
  )

  /** Counts of outcomes. */
  private def outcomes(answers: Seq[(BounceCase, Seq[BigInt])]): Map[String, Int] = answers.map {
    case (hit, answer) =>
      if (!hit.isGlass) "mirror" else if (answer.head == 0) "total" else if (answer.last == 0) "back" else "front"
  }.groupBy(identity).map { case (name, all) => name -> all.size }

  /** Compares bounces with the model, one offset after another. */
  private def check(
      config: ColonnadeConfig,
      rounds: Seq[(BigInt, Seq[BounceCase])],
      random: Random,
      stalls: Int => Double
  )(unit: BounceUnit): Unit = {
    val asked   = rounds.flatMap { case (offset, stimulus) => stimulus.map(_.words(offset)) }
    val answers = Model.answers(config, asked, "bounce")
    val left    = answers.iterator
    info(s"${outcomes(rounds.flatMap(_._2).zip(answers))}")
    for (((offset, stimulus), round) <- rounds.zipWithIndex) {
      unit.io.offset.poke(offset)
      var poked   = Option.empty[BounceCase]
      val results =
        StreamTester.exchange(unit.clock, unit.io.request, unit.io.result, stimulus)(
          (port: BounceRequest, hit: BounceCase) =>
            if (!poked.exists(_ eq hit)) {
              poke(config, offset)(port, hit)
              poked = Some(hit)
            },
          peek
        )(random, stalls(round), 400)
      results.zip(stimulus).foreach { case (result, hit) =>
        val answer = left.next() :+ BigInt(hit.context)
        assert(unpack(result, answer.size) == answer, s"of $hit with the offset $offset in ${config.precision}")
      }
    }
  }

  for (config <- TestConfigs.formats) {
    val name = s"${config.precision} and ${config.geometry.vertexBits}-bit vertices"

    it should s"equal the model with $name" in test(new BounceUnit(config)).withAnnotations(simulation) { unit =>
      val random   = new Random(31)
      val stimulus = new BounceStimulus(config, random)
      val rounds   = Seq.fill(5) {
        val all =
          Seq.fill(6)(stimulus.surface()) ++ Seq.fill(4)(stimulus.any()) ++ Seq.fill(4)(stimulus.grazing()) ++
            Seq.fill(4)(stimulus.critical()) ++ Seq.fill(2)(stimulus.extreme()) ++
            Seq(
              stimulus.straight(),
              stimulus.perpendicular(),
              stimulus.withoutNormal(),
              stimulus.surface(spread = 1500)
            )
        stimulus.offset() -> random.shuffle(all)
      }
      check(config, rounds, random, _ % 2 * 0.7)(unit)
    }
  }

  /** Cycles from taking each request to offering its result; the unit is idle before. */
  private def latencies(config: ColonnadeConfig, stimulus: Seq[BounceCase])(unit: BounceUnit): Seq[Int] = {
    unit.io.offset.poke(100)
    unit.io.result.ready.poke(true)
    for (hit <- stimulus) yield {
      poke(config, 100)(unit.io.request.bits, hit)
      unit.io.request.valid.poke(true)
      unit.clock.step()
      unit.io.request.valid.poke(false)
      var cycles = 1
      while (!unit.io.result.valid.peekBoolean()) {
        unit.clock.step()
        cycles += 1
      }
      unit.clock.step()
      assert(unit.io.request.ready.peekBoolean(), "the next bounce has to wait")
      cycles
    }
  }

  it should "hold its latencies at 32b32s64d" in test(new BounceUnit(TestConfigs.tiny)).withAnnotations(simulation) {
    unit =>
      val stimulus = new BounceStimulus(TestConfigs.tiny, new Random(37))

      def held(name: String, least: Int, most: Int)(hit: => BounceCase): Unit = {
        val cycles = latencies(TestConfigs.tiny, Seq.fill(12)(hit))(unit)
        info(s"$name: ${cycles.min} to ${cycles.max} cycles")
        assert(cycles.min >= least && cycles.max <= most, s"$name: $cycles")
      }
      // With the geometric normal, so that nothing starts over
      def surface(eta: Int, backSide: Boolean, isGlass: Boolean = true) = {
        val hit = stimulus.surface().copy(isFlat = true, isGlass = isGlass, etas = Seq.fill(2)(BigInt(eta)))
        val faceForwardNormal = hit.faceForwardNormal
        hit.copy(backSide = backSide, geometricNormal = faceForwardNormal.map(x => if (backSide) -x else x))
      }
      held("mirror", 44, 44)(surface(8192, backSide = false, isGlass = false))
      held("total reflection", 56, 56)(surface(65535, backSide = true))
      held("glass from behind", 104, 104)(surface(5461, backSide = true))
      held("glass from the front", 168, 200)(surface(5461, backSide = false))
  }
}
