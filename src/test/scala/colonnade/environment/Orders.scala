package colonnade.environment

import chisel3.{assert => _, _}
import chisel3.util.{Decoupled, DecoupledIO, Valid}
import chiseltest._
import colonnade.TestParts._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{EnvironmentView, Load}
import colonnade.{Model, Packed}
import org.scalatest.Assertions._

import scala.util.Random

/** A unit that finds the points of orders, with slow maps; each wide port is one number. */
abstract class OrderHarness(config: ColonnadeConfig) extends Module {
  private val maps = Module(new PhysicalAttributeMemory(config, 1, tagBits = 0))

  val load      = IO(Flipped(Valid(new Load(config))))
  val view      = IO(Input(UInt(new EnvironmentView(config.numbers).getWidth.W)))
  val order     = IO(Flipped(Valid(UInt(new MarchOrder(config).getWidth.W))))
  val isSlow    = IO(Input(Bool()))
  val isReady   = IO(Output(Bool())) // for an order in the next cycle, unless one comes now
  val answer    = IO(Decoupled(UInt(new MarchAnswer(config).getWidth.W)))
  val isIllegal = IO(Output(Bool()))
  maps.io.load := load

  protected def connect(
      unitView:   EnvironmentView,
      unitOrder:  Valid[MarchOrder],
      unitAnswer: DecoupledIO[MarchAnswer],
      unitMaps:   AttributePort
  ): Unit = {
    unitView         := view.asTypeOf(unitView)
    unitOrder.valid  := order.valid
    unitOrder.bits   := order.bits.asTypeOf(unitOrder.bits)
    unitAnswer.ready := answer.ready
    answer.valid     := unitAnswer.valid
    answer.bits      := unitAnswer.bits.asUInt
    SlowMaps.connect(unitMaps, maps.io.ports.head, isSlow)
  }
}

/** Orders to a unit, and its answers beside the model's.
  *
  * @param words of the maps, by memory
  */
final class Orders(
    dut:    OrderHarness,
    config: ColonnadeConfig,
    view:   ViewCase,
    words:  Map[String, Seq[BigInt]],
    random: Random
) {
  private val (order, answer) = (new Packed(new MarchOrder(config)), new Packed(new MarchAnswer(config)))

  /** Of the last rays. */
  var cycles = 0

  dut.view.poke(new Packed(new EnvironmentView(config.numbers)).pack(view.fields))

  /** Fields of an answer; those of a point, only if there is one. */
  private def meant(bits: BigInt): Map[String, BigInt] = {
    val values = answer.unpack(bits).map { case (name, value) => name.replace("surface.", "") -> value }
    if (values("isHit") == 1) values else values.filterNot(_._1.contains("."))
  }

  /** Asks for all rays, in order, half of them as occlusion tests; returns the model's answers.
    *
    * @param willing probability that an answer is taken in a cycle
    */
  def check(rays: Seq[MarchCase], willing: Double, isSlow: Boolean): Seq[Map[String, BigInt]] = {
    val isTest = rays.map(_ => random.nextBoolean())
    dut.isSlow.poke(isSlow)
    var sent      = 0
    var found     = Vector.empty[BigInt]
    var offered   = Option.empty[BigInt]
    var mayOrder  = false
    var isIllegal = false
    cycles = 0
    while (found.size < rays.size) {
      val sends = mayOrder && sent < rays.size && (willing == 1 || random.nextInt(4) > 0)
      dut.order.valid.poke(sends)
      if (sends) {
        val fields = rays(sent).fields(config.numbers.shadeBits)
        dut.order.bits.poke(order.pack(fields - "context" - "isDirectView" ++ Map(
          "request.context"             -> fields("context"),
          "request.isDirectView"        -> fields("isDirectView"),
          "request.isFresnelReflection" -> BigInt(sent % 2),
          "request.isOcclusionTest"     -> BigInt(if (isTest(sent)) 1 else 0)
        )))
        sent += 1
      }
      val accepts = random.nextDouble() < willing
      val now     = Option.when(dut.answer.valid.peekBoolean())(dut.answer.bits.peekInt())
      assert(offered.isEmpty || now.map(meant) == offered.map(meant), "an answer is offered until it is taken")
      offered = now.filterNot(_ => accepts)
      dut.answer.ready.poke(accepts)
      if (accepts) found ++= now
      isIllegal |= dut.isIllegal.peekBoolean()
      mayOrder = !sends && dut.isReady.peekBoolean()
      cycles += 1
      assert(cycles < 2000 * rays.size, s"${found.size} answers")
      dut.clock.step()
    }
    dut.order.valid.poke(false)

    val expected = Model
      .attributes(config, words, rays.map(ray => view.words ++ ray.words), "march")
      .map(MarchCase.answer.zip(_).toMap)
    for ((((bits, expected), ray), index) <- found.zip(expected).zip(rays).zipWithIndex) {
      val values = meant(bits)
      val isHit  = if (isTest(index)) expected("hidesObject") == 1 else expected("kind") != HitKind.miss.litValue
      assert(values("isHit") == (if (isHit) 1 else 0), s"of $ray in $view")
      assert(values("isOcclusionTest") == (if (isTest(index)) 1 else 0))
      assert(values("context") == ray.context && values("shadows") == 1 - index % 2)
      if (isHit) for ((name, value) <- expected if values.contains(name))
        assert(values(name) == value, s"$name of $ray in $view")
    }
    assert(isIllegal == expected.exists(_("isIllegal") == 1))
    expected
  }
}
