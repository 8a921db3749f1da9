package colonnade.unit

import colonnade.Model
import colonnade.config.ColonnadeConfig
import org.scalatest.Assertions._

/** A frame with the pixels that the model shows.
  *
  * @param registers the host's, by name
  * @param size      pixels
  * @param maps      words of each memory of the environment, if there is one
  */
final class SmallFrame(
    config:        ColonnadeConfig,
    val registers: Map[String, BigInt],
    val records:   Seq[BigInt],
    size:          (Int, Int),
    maps:          Option[Map[String, Seq[BigInt]]] = None
) {
  import SmallFrame._

  val positions: Seq[(Int, Int)] = for (x <- 0 until size._1; y <- 0 until size._2) yield (x, y)

  /** In the order of the positions, with other registers. */
  def modelled(registers: Map[String, BigInt]): Seq[Map[String, BigInt]] =
    Model.pixels(config, registers, records, positions, maps).map(names.zip(_).toMap)

  val expected: Seq[Map[String, BigInt]] = modelled(registers)

  /** Pixels that show the object. */
  val hits: Int = expected.count(_("isObject") == 1)

  /** Each pixel comes once, with the model's values, and those that show the object are counted. */
  def check(pixels: Seq[((Int, Int), Map[String, BigInt])], counts: String => Int): Unit = {
    assert(pixels.map(_._1).sorted == positions.sorted, "every position comes out once")
    val found = pixels.toMap
    for ((position, pixel) <- positions.zip(expected))
      assert(found(position) == pixel.filter(value => found(position).contains(value._1)), s"at $position")
    assert(counts("hits") == hits)
  }

  /** Rays of all kinds that the frame may have are traced. */
  def checkRays(counts: String => Int, shadows: Boolean): Unit = {
    assert(hits > positions.size / 16, "there is something to see")
    assert(if (shadows) counts("raysShadow") > hits / 8 else counts("raysShadow") == 0)
    assert((counts("raysReflection") + counts("raysRefraction") > 0) == config.frame.hasBounces)
  }
}

object SmallFrame {
  private val names = Seq("colour.r", "colour.g", "colour.b", "isObject", "hit.triangle", "hit.distance") ++
    Seq("r", "g", "b").map(channel => s"ratio.$channel")

  val (wide, high) = (12, 8)

  def scene(config: ColonnadeConfig, seed: Int, shadows: Boolean): SmallScene =
    new SmallScene(config, seed, wide, high, triangleCount = 15, shadows)

  /** Of a small scene without an environment. */
  def apply(config: ColonnadeConfig, scene: SmallScene): SmallFrame =
    new SmallFrame(config, scene.registers, scene.records, (wide, high))
}
