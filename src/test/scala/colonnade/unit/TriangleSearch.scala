package colonnade.unit

import colonnade.Model
import colonnade.Packed
import colonnade.config.ColonnadeConfig
import colonnade.formats.{RecordFormats, TrianglesRecord}
import colonnade.shading.Occlusion

/** Finds what rays meet in a small scene by the model's test of each triangle, without a tree. */
final class TriangleSearch(config: ColonnadeConfig, scene: SmallScene) {
  import TriangleSearch._

  /** With the address of its record. */
  val triangles: Vector[(Int, Triangle)] = {
    val layout        = new Packed(new RecordFormats(config).triangles)
    val Seq(from, to) = Seq("triangleBase", "attributeBase").map(name => scene.registers(s"scene.$name").toInt)
    for {
      address <- (from until to).toVector
      fields = layout.unpack(scene.records(address))
      k <- 0 until fields("count").toInt
    } yield {
      val vertices = (3 * k until 3 * k + 3).map(i => Seq("x", "y", "z").map(axis => fields(s"vertices[$i].$axis")))
      address -> Triangle(TrianglesRecord.most * address + k, fields(s"isClear[$k]") == 1, vertices)
    }
  }

  /** By ray, given by the fields of a [[colonnade.ray.PreparedRay]]: occlusion of a shadow ray, or the fields of its closest
    * hit.
    */
  def hits(rays: Seq[Fields], among: Seq[Triangle]): Vector[(Occlusion.Type, Option[Fields])] = {
    val pairs   = for (ray <- rays; triangle <- among) yield forTriangles(ray) ++ triangle.vertices.flatten
    val answers = Model.answers(config, pairs, "triangle").grouped(among.size).toVector
    rays.toVector.zip(answers).map { case (ray, answers) =>
      val hits = among.zip(answers).filter { case (_, hit) => hit.head == 1 && hit(1) < ray("tMax") }
      if (ray("isShadow") == 1) {
        val isOpaque = hits.exists { case (triangle, _) => !triangle.isTransmissive || !config.frame.hasBounces }
        val met      = if (isOpaque) Occlusion.opaque else if (hits.nonEmpty) Occlusion.transmissive else Occlusion.none
        (met, None)
      } else
        (
          Occlusion.none,
          hits.minByOption { case (triangle, hit) => (hit(1), triangle.id) }.map { case (triangle, hit) =>
            Map("t" -> hit(1), "id" -> triangle.id, "backSide" -> hit(5)) ++
              (0 until 3).map(i => s"weights[$i]" -> hit(2 + i))
          }
        )
    }
  }
}

object TriangleSearch {
  type Fields = Map[String, BigInt]

  final case class Triangle(id: BigInt, isTransmissive: Boolean, vertices: Seq[Seq[BigInt]])

  /** The ray's numbers in the order of the model's question `triangle`. */
  private def forTriangles(ray: Fields): Seq[BigInt] = {
    val numbers = Seq("orientation.axis") ++ (0 until 3).map(i => s"orientation.negative[$i]") ++
      (0 until 3).map(i => s"origin[$i]") ++ (0 until 2).map(i => s"shear[$i]")
    numbers.map(name => ray(s"ray.$name"))
  }
}
