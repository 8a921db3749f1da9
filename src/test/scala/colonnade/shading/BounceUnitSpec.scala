package colonnade.shading

import chisel3._
import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.numbers.{Fixed, StreamTester}
import colonnade.{Model, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

class BounceUnitSpec extends AnyFlatSpec with ChiselScalatestTester {
  import AnswerPacking._

  behavior of "BounceUnit"

  private val simulation = Simulation.verilator

  private def poke(config: ColonnadeConfig, offset: BigInt)(port: BounceRequest, question: BounceQuestion): Unit = {
    val numbers                                         = config.numbers
    def set(to:   Seq[SInt], values: Seq[BigInt]): Unit = to.zip(values).foreach { case (to, value) => to.poke(value) }
    def fixed(to: Fixed, value:      BigInt): Unit      = to.raw.asInstanceOf[UInt].poke(value)
    port.context.poke(question.context)
    set(port.origin.axes, question.origin(offset))
    set(port.normal.axes, question.normal(numbers))
    port.isSmooth.poke(question.isSmooth)
    set(port.facing.axes, question.facing)
    set(port.towards.axes, question.towards(numbers))
    port.backSide.poke(question.backSide)
    port.isGlass.poke(question.isGlass)
    fixed(port.eta, question.eta)
    fixed(port.reflectance, question.reflectance)
  }

  private def peek(result: BounceResult): BigInt = pack(
    (result.isRefraction.peekInt() +: result.origin.axes.map(_.integer.peekInt())) ++
      (result.towards.axes ++ result.reflection.axes).map(_.peekInt()) ++
      Seq(result.share.natural.peekInt(), result.context.peekInt())
  )

  /** How many of each outcome there were. */
  private def outcomes(answers: Seq[(BounceQuestion, Seq[BigInt])]): Map[String, Int] = answers.map {
    case (question, answer) =>
      if (!question.isGlass) "mirror" else if (answer.head == 0) "total" else if (answer.last == 0) "back" else "front"
  }.groupBy(identity).map { case (name, all) => name -> all.size }

  /** Has rays bounced, an offset after another, and compares with the model. */
  private def check(
      config: ColonnadeConfig,
      rounds: Seq[(BigInt, Seq[BounceQuestion])],
      random: Random,
      stalls: Int => Double
  )(unit: BounceUnit): Unit = {
    val asked   = rounds.flatMap { case (offset, questions) => questions.map(_.words(offset)) }
    val answers = Model.answers(config, asked, "bounce")
    val left    = answers.iterator
    info(s"${outcomes(rounds.flatMap(_._2).zip(answers))}")
    for (((offset, questions), round) <- rounds.zipWithIndex) {
      unit.io.offset.poke(offset)
      var poked   = Option.empty[BounceQuestion]
      val results =
        StreamTester.exchange(unit.clock, unit.io.request, unit.io.result, questions)(
          (port: BounceRequest, question: BounceQuestion) =>
            if (!poked.exists(_ eq question)) {
              poke(config, offset)(port, question)
              poked = Some(question)
            },
          peek
        )(random, stalls(round), 400)
      results.zip(questions).foreach { case (result, question) =>
        val answer = left.next() :+ BigInt(question.context)
        assert(unpack(result, answer.size) == answer, s"of $question with the offset $offset in ${config.precision}")
      }
    }
  }

  for (config <- TestConfigs.formats) {
    val name = s"${config.precision} and ${config.geometry.vertexBits}-bit vertices"

    it should s"equal the model with $name" in test(new BounceUnit(config)).withAnnotations(simulation) { unit =>
      val random    = new Random(31)
      val questions = new BounceQuestions(config, random)
      val rounds    = Seq.fill(5) {
        val all =
          Seq.fill(6)(questions.surface()) ++ Seq.fill(4)(questions.any()) ++ Seq.fill(4)(questions.grazing()) ++
            Seq.fill(4)(questions.critical()) ++ Seq.fill(2)(questions.extreme()) ++
            Seq(questions.straight(), questions.withoutNormal(), questions.surface(spread = 1500))
        questions.offset() -> random.shuffle(all)
      }
      check(config, rounds, random, _ % 2 * 0.7)(unit)
    }
  }

  /** Cycles from taking each request to offering its result; the unit is idle before. */
  private def latencies(config: ColonnadeConfig, questions: Seq[BounceQuestion])(unit: BounceUnit): Seq[Int] = {
    unit.io.offset.poke(100)
    unit.io.result.ready.poke(true)
    for (question <- questions) yield {
      poke(config, 100)(unit.io.request.bits, question)
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
      val questions = new BounceQuestions(TestConfigs.tiny, new Random(37))

      def held(name: String, most: Int)(question: => BounceQuestion): Unit = {
        val cycles = latencies(TestConfigs.tiny, Seq.fill(12)(question))(unit)
        info(s"$name: ${cycles.min} to ${cycles.max} cycles")
        assert(cycles.max <= most, s"$name: $cycles")
      }
      // With the geometric normal, so that nothing starts over
      def surface(eta: Int, backSide: Boolean, isGlass: Boolean = true) = {
        val question = questions.surface().copy(isFlat = true, isGlass = isGlass, etas = Seq.fill(2)(BigInt(eta)))
        val facing   = question.facing
        question.copy(backSide = backSide, geometricNormal = facing.map(x => if (backSide) -x else x))
      }
      held("mirror", 44)(surface(8192, backSide = false, isGlass = false))
      held("total reflection", 56)(surface(65535, backSide = true))
      held("glass from behind", 104)(surface(5461, backSide = true))
      held("glass from the front", 200)(surface(5461, backSide = false))
  }
}
